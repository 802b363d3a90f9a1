//! Hostile inputs of our own making over all readers: read, rendered, and nothing may panic, abort, hang, fill memory
//! or give a value that is not finite.
//!
//! ```text
//! cargo test --test hostile                                      300 runs, a few seconds
//! HOSTILE_RUNS=10000 HOSTILE_SEED=7 cargo test --test hostile    so many, from another seed
//! HOSTILE_RUNS=123..124 HOSTILE_KEEP=DIR cargo test --test hostile    one run alone; its files stay in DIR
//! ```
//!
//! A run takes a small valid file of some reader (`seeds`), damages it (`mutate`), reads it and renders a small picture
//! (`run`). It depends on the seed and on its number alone. Runs are made in a process of their own, which tells where
//! it is: this one sees a run that ends the process, or that takes too long, and goes on behind it. That process may
//! take [`MOST_MEMORY`]. What a run found belongs into `fuzz/corpus/`, where later runs begin.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

mod mutate;
mod run;
mod seeds;

use std::fs::{self, File, OpenOptions};
use std::io::Write as _;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use run::{Outcome, Runs};

/// Runs where nothing else is asked for.
const USUAL: u64 = 300;

/// Address space of the process that makes the runs, KiB: 4 GiB, of which the program and its threads take a part.
const MOST_MEMORY: u64 = 4 << 20;

/// A process that works is given so many times as long by the clock: other programs may have the processor.
const WAITING: u32 = 4;

/// After so many failures the rest is not run.
const MOST_FAILURES: usize = 50;

/// A variable of the environment.
fn asked<T: std::str::FromStr>(name: &str) -> Option<T> {
    let text = std::env::var(name).ok()?;
    Some(text.parse().unwrap_or_else(|_| panic!("{name}={text} cannot be read")))
}

/// Most that a run may take.
fn patience() -> Duration {
    Duration::from_secs_f64(asked("HOSTILE_PATIENCE").unwrap_or(10.0))
}

/// The numbers of the runs: a count, or `FROM..TO`.
fn numbers() -> Range<u64> {
    let Ok(text) = std::env::var("HOSTILE_RUNS") else { return 0..USUAL };
    let number = |text: &str| text.parse().unwrap_or_else(|_| panic!("HOSTILE_RUNS={text} is no number"));
    match text.split_once("..") {
        Some((from, to)) => number(from)..number(to),
        None => 0..number(&text),
    }
}

/// What the runs found.
#[derive(Default)]
struct Found {
    refused: usize,
    rendered: usize,
    /// Number of the run, and what was wrong.
    failures: Vec<(u64, String)>,
    slowest: Duration,
}

/// Starts the process that makes some runs. `plant`: a number, and what goes wrong there.
fn start(log: &Path, seed: u64, numbers: &Range<u64>, plant: Option<(u64, &str)>, patience: Duration) -> Child {
    let program = std::env::current_exe().unwrap();
    let mut command = if cfg!(unix) {
        let mut command = Command::new("sh");
        command.args(["-c", &format!("ulimit -v {MOST_MEMORY}; exec \"$0\" \"$@\"")]).arg(program);
        command
    } else {
        Command::new(program)
    };
    command
        .args(["--exact", "the_process_that_makes_the_runs", "--ignored", "--nocapture"])
        .env("HOSTILE_LOG", log)
        .env("HOSTILE_SEED", seed.to_string())
        .env("HOSTILE_RUNS", format!("{}..{}", numbers.start, numbers.end))
        .env("HOSTILE_PATIENCE", patience.as_secs_f64().to_string())
        // Each thread has an address space of its own.
        .env("RAYON_NUM_THREADS", "2")
        .env("MALLOC_ARENA_MAX", "2")
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    if let Some((number, kind)) = plant {
        command.env("HOSTILE_PLANT", format!("{number} {kind}"));
    }
    command.spawn().unwrap()
}

/// Processor time of a process, as Linux tells it; elsewhere more than any run may take, so that the clock decides.
fn processor_time(child: &Child) -> Duration {
    let Ok(text) = fs::read_to_string(format!("/proc/{}/stat", child.id())) else { return Duration::MAX / 2 };
    // The name, in brackets, may have blanks. The times are the 12th and the 13th word behind it, in hundredths.
    let words = text.rsplit_once(')').map_or("", |(_, words)| words).split_whitespace().skip(11).take(2);
    Duration::from_millis(10 * words.filter_map(|word| word.parse::<u64>().ok()).sum::<u64>())
}

/// Makes runs until all are made.
fn make(seed: u64, numbers: Range<u64>, plant: Option<(u64, &str)>, patience: Duration) -> Found {
    let place = tempfile::tempdir().unwrap();
    let mut found = Found::default();
    let mut next = numbers.start;
    while next < numbers.end && found.failures.len() < MOST_FAILURES {
        let log = place.path().join(format!("log-{next}"));
        File::create(&log).unwrap();
        let mut child = start(&log, seed, &(next..numbers.end), plant, patience);
        let (mut length, mut changed, mut spent) = (0, Instant::now(), Duration::ZERO);
        // Starting the process takes a while, too.
        let limit = patience + Duration::from_secs(2);
        let (why, ended) = loop {
            if let Some(status) = child.try_wait().unwrap() {
                break (format!("the process ended ({status})"), status.success());
            }
            let now = fs::metadata(&log).unwrap().len();
            if now != length {
                (length, changed, spent) = (now, Instant::now(), processor_time(&child));
            } else if changed.elapsed() > limit
                && (processor_time(&child).saturating_sub(spent) > patience || changed.elapsed() > WAITING * limit)
            {
                child.kill().unwrap();
                child.wait().unwrap();
                break (format!("it takes longer than {patience:?}"), false);
            }
            std::thread::sleep(Duration::from_millis(20));
        };
        let (last, open) = read(&log, &mut found);
        assert!(last.is_some() || !ended, "the process made no runs");
        match (last, open) {
            (Some(last), false) if ended || last + 1 >= numbers.end => next = last + 1,
            // It fell in this run, or between two.
            (Some(last), _) => {
                found.failures.push((last, why));
                next = last + 1;
            }
            (None, _) => panic!("the process makes no runs: {why}"),
        }
    }
    found
}

/// Adds what a log says. Gives the last run that was begun, and whether it did not end.
fn read(log: &Path, found: &mut Found) -> (Option<u64>, bool) {
    let text = fs::read_to_string(log).unwrap();
    let (mut last, mut open) = (None, false);
    for line in text.lines() {
        let (word, rest) = line.split_once(' ').unwrap_or((line, ""));
        match word {
            "begin" => (last, open) = (rest.parse().ok(), true),
            "refused" => found.refused += 1,
            "rendered" => found.rendered += 1,
            _ => found.failures.push((last.unwrap_or(0), rest.to_owned())),
        }
        if word != "begin" {
            open = false;
            let seconds = rest.split(' ').next().and_then(|text| text.parse().ok()).unwrap_or(0.0);
            found.slowest = found.slowest.max(Duration::from_secs_f64(seconds));
        }
    }
    (last, open)
}

// Not deep: the only test of all readers with damaged files.
#[test]
fn hostile_inputs_are_refused_or_rendered() {
    let (seed, numbers) = (asked("HOSTILE_SEED").unwrap_or(1), numbers());
    let start = Instant::now();
    let found = make(seed, numbers.clone(), None, patience());
    println!(
        "runs {numbers:?} of seed {seed}: {} refused, {} rendered, {} failed; the slowest took {:.2?}; {:.1?} in all",
        found.refused,
        found.rendered,
        found.failures.len(),
        found.slowest,
        start.elapsed()
    );
    let runs = Runs::new();
    let line = |(number, why): &(u64, String)| {
        let input = runs.input(seed, *number);
        format!("HOSTILE_SEED={seed} HOSTILE_RUNS={number}..{}: {}: {why}", number + 1, input.name)
    };
    if let Some(keep) = asked::<PathBuf>("HOSTILE_KEEP") {
        for number in if found.failures.is_empty() { numbers } else { 0..0 }.chain(found.failures.iter().map(|f| f.0)) {
            let folder = keep.join(number.to_string());
            fs::create_dir_all(&folder).unwrap();
            runs.input(seed, number)
                .files
                .iter()
                .for_each(|(name, bytes)| fs::write(folder.join(name), bytes).unwrap());
        }
    }
    let failed: Vec<String> = found.failures.iter().map(line).collect();
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

/// What a run may do wrong is found, with its number, and the runs behind it are made.
// Not deep: it waits 20 s for the run that hangs, and takes little of the processor.
#[test]
fn what_is_planted_is_found() {
    let planted = [
        ("panic", "panicked: planted"),
        ("overflow", "panicked: attempt to add with overflow"),
        ("nan", "not finite"),
        ("hang", "takes longer than"),
        ("abort", "the process ended"),
        #[cfg(unix)]
        ("memory", "the process ended"),
    ];
    for (kind, says) in planted {
        let found = make(1, 5..9, Some((7, kind)), Duration::from_secs(3));
        assert_eq!(found.refused + found.rendered, 3, "{kind}: {:?}", found.failures);
        assert!(matches!(found.failures.as_slice(), [(7, why)] if why.contains(says)), "{kind}: {:?}", found.failures);
    }
}

/// A seed is read before it is damaged, but for those that are not to be.
// Not deep: damage to a seed that is refused anyway finds nothing, and nothing else says so.
#[test]
fn seeds_are_valid() {
    let runs = Runs::new();
    let mut rendered = 0;
    for input in runs.all() {
        let place = tempfile::tempdir().unwrap();
        let outcome = Runs::run(input, 1, 1, place.path()).unwrap();
        let may_be_refused = input.name.contains("bad-");
        // Colours of a printer are no texture, a JPEG is no rendered picture, and no run has this hash.
        let is_foreign =
            ["cmyk", "environment", "transforms.json", ".jpg", ".webp"].iter().any(|word| input.name.contains(word));
        assert!(outcome == Outcome::Rendered || may_be_refused || is_foreign, "{}", input.name);
        rendered += usize::from(outcome == Outcome::Rendered);
    }
    assert!(rendered > 60, "{rendered}");
}

/// Found by run 1333 of seed 3: what the decoder says of a JPEG that ends early had two lines.
#[test]
fn a_texture_that_is_cut_short_is_refused_in_one_line() {
    let runs = Runs::new();
    let input = runs.all().find(|input| input.name == "mesh with grey.jpg").unwrap();
    let length = input.files[2].1.len();
    for length in (0..length).step_by(length / 40) {
        let mut cut = input.clone();
        cut.files[2].1.truncate(length);
        let place = tempfile::tempdir().unwrap();
        Runs::run(&cut, 1, 1, place.path()).unwrap();
    }
}

/// Begins runs, and says so in a file before and after each.
#[test]
#[ignore = "the other tests start it"]
fn the_process_that_makes_the_runs() {
    static PANIC: Mutex<String> = Mutex::new(String::new());
    let Some(log) = asked::<PathBuf>("HOSTILE_LOG") else { return };
    let seed = asked("HOSTILE_SEED").unwrap();
    let plant = std::env::var("HOSTILE_PLANT").ok();
    let mut log = OpenOptions::new().append(true).open(log).unwrap();
    let mut say = |line: &str| log.write_all(format!("{}\n", line.replace('\n', " ")).as_bytes()).unwrap();
    std::panic::set_hook(Box::new(|info| {
        let what = info.payload_as_str().unwrap_or("something");
        let place = info.location().map_or_else(String::new, |at| format!(" ({}:{})", at.file(), at.line()));
        if let Ok(mut text) = PANIC.lock() {
            *text = format!("panicked: {what}{place}");
        }
    }));
    let runs = Runs::new();
    for number in numbers() {
        say(&format!("begin {number}"));
        let place = tempfile::tempdir().unwrap();
        let begun = Instant::now();
        let planted = plant.as_deref().and_then(|plant| plant.strip_prefix(&format!("{number} ")));
        let outcome = catch_unwind(AssertUnwindSafe(|| match planted {
            Some(kind) => run::plant(kind),
            None => Runs::run(&runs.input(seed, number), seed, number, place.path()),
        }));
        let seconds = begun.elapsed().as_secs_f64();
        match outcome {
            Ok(Ok(Outcome::Refused)) => say(&format!("refused {seconds}")),
            Ok(Ok(Outcome::Rendered)) => say(&format!("rendered {seconds}")),
            Ok(Err(why)) => say(&format!("failed {why}")),
            Err(_) => say(&format!("failed {}", PANIC.lock().map_or_else(|_| String::new(), |text| text.clone()))),
        }
    }
}
