//! Completions and manual pages.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

use std::collections::BTreeSet;
use std::io::Write as _;
use std::process::{Command, Stdio};

fn splatblur(arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_splatblur")).args(arguments).stdin(Stdio::null()).output().unwrap();
    assert_eq!((output.status.code(), output.stderr.len()), (Some(0), 0), "{arguments:?}");
    String::from_utf8(output.stdout).unwrap()
}

/// The long options that a text names.
fn options(text: &str) -> BTreeSet<String> {
    let text = text.replace("\\-", "-");
    let names = text.match_indices("--").map(|(at, _)| {
        let name = &text[at + 2..];
        name[..name.find(|c: char| !c.is_ascii_lowercase() && c != '-').unwrap_or(name.len())].to_owned()
    });
    names.filter(|name| name.len() > 1).collect()
}

#[test]
fn every_shell_has_completions() {
    let wanted = options(&splatblur(&["help", "render"]).split("Blur:").next().unwrap().replace('\n', " \n"));
    assert!(wanted.contains("frames") && wanted.contains("compression"), "{wanted:?}");
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = splatblur(&["completions", shell]);
        assert_eq!(script, splatblur(&["completions", shell]), "{shell}");
        for option in ["frames", "compression", "samples-max", "no-sums"] {
            assert!(script.contains(option), "{shell}: {option}");
        }
        for command in ["render", "reference", "compare", "sheet", "report", "info", "convert", "generate", "man"] {
            assert!(script.contains(command), "{shell}: {command}");
        }
    }
}

/// What bash itself makes of it.
#[test]
fn bash_completes() {
    let script = splatblur(&["completions", "bash"]);
    let ask = |words: &str, word: &str, before: &str| {
        format!(
            "COMP_WORDS=({words}); COMP_CWORD={}; COMPREPLY=(); _splatblur splatblur {word} {before}; \
             echo \"${{COMPREPLY[@]}}\"\n",
            words.split(' ').count() - 1
        )
    };
    let option = ask("splatblur render --compr", "--compr", "render");
    let value = ask("splatblur render --compression z", "z", "--compression");
    let Ok(mut bash) = Command::new("bash").arg("-s").stdin(Stdio::piped()).stdout(Stdio::piped()).spawn() else {
        return println!("SKIPPED bash_completes: there is no bash");
    };
    bash.stdin.take().unwrap().write_all((script + "\n" + &option + &value).as_bytes()).unwrap();
    let output = String::from_utf8(bash.wait_with_output().unwrap().stdout).unwrap();
    assert_eq!(output, "--compression\nzips zip\n");
}

#[test]
fn every_command_has_a_manual_page_with_all_its_options() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("man/man1");
    assert_eq!(splatblur(&["man", "--out", out.to_str().unwrap()]), "");
    let read = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
    assert_eq!(read("splatblur.1"), splatblur(&["man"]));
    let mut pages = 0;
    for entry in std::fs::read_dir(&out).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        let page = read(&name);
        assert!(page.contains(&format!(".TH {}", name.strip_suffix(".1").unwrap())), "{name}");
        if let Some(command) = name.strip_prefix("splatblur-") {
            pages += 1;
            let command = command.strip_suffix(".1").unwrap();
            let help = options(&splatblur(&["help", command]));
            let missing: Vec<_> = help.difference(&options(&page)).cloned().collect();
            assert!(missing.is_empty(), "{name}: {missing:?}");
        }
    }
    // Those of the commands, each under its full name.
    assert_eq!(pages, 15 + usize::from(cfg!(feature = "viewer")));
}
