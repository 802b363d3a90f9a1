//! How much memory there is, and the share of it that rendering takes where `--memory` does not say.
//!
//! Linux tells in four places: the computer's memory, the limits of control groups of version 1 and 2 (containers are
//! made of these), and the limit of the process's address space. Where a system tells nothing, nothing is assumed. The
//! images do not depend on any of this.

use std::path::Path;

use splatblur::files;

use super::output::say;

/// What rendering takes at least, and where the system tells nothing.
const LEAST: u64 = 1 << 30;
/// What rendering takes at most by itself on a graphics device, whose own memory the system does not tell.
const MOST_OF_DEVICE: u64 = 8 << 30;

/// Bytes that rendering may take. By default that is half of what there is, but not less than 1G; on a graphics device
/// not more than 8G. More than there is is not taken, whoever asks: that would end in an abort instead of a message.
pub(crate) fn budget(given: Option<u64>, on_device: bool, quiet: bool) -> u64 {
    let available = available();
    if let (Some(given), Some(available)) = (given, available)
        && given > available
        && !quiet
    {
        say(&format!("note: --memory {} is more than there is; taking {}", text(given), text(available)));
    }
    share(given, available, on_device)
}

fn share(given: Option<u64>, available: Option<u64>, on_device: bool) -> u64 {
    let most = if on_device { MOST_OF_DEVICE } else { u64::MAX };
    match (given, available) {
        (Some(given), available) => given.min(available.unwrap_or(u64::MAX)),
        (None, Some(available)) => (available / 2).min(most).max(LEAST),
        (None, None) => LEAST,
    }
}

/// Bytes that this process can have; `None` where the system does not tell.
pub(super) fn available() -> Option<u64> {
    limit(&files::of_system)
}

/// An amount of memory for people: `1.5G`, `640M`.
pub(super) fn text(bytes: u64) -> String {
    let mebibytes = bytes as f64 / f64::from(1 << 20);
    if mebibytes < 1024.0 { format!("{mebibytes:.0}M") } else { format!("{:.1}G", mebibytes / 1024.0) }
}

/// The least of all limits. `read` gives the text of a file of the system.
fn limit(read: &dyn Fn(&Path) -> Option<String>) -> Option<u64> {
    let mut limits = Vec::new();
    if let Some(text) = read(Path::new("/proc/meminfo")) {
        limits.extend(field(&text, "MemTotal:").and_then(|kibibytes: u64| kibibytes.checked_mul(1024)));
    }
    if let Some(text) = read(Path::new("/proc/self/limits")) {
        limits.extend(field(&text, "Max address space"));
    }
    for line in read(Path::new("/proc/self/cgroup")).unwrap_or_default().lines() {
        // hierarchy:controllers:path
        let mut parts = line.splitn(3, ':');
        let (Some(hierarchy), Some(controllers), Some(path)) = (parts.next(), parts.next(), parts.next()) else {
            continue;
        };
        let (mounts, file): (&[&str], &str) = if hierarchy == "0" && controllers.is_empty() {
            (&["/sys/fs/cgroup", "/sys/fs/cgroup/unified"], "memory.max")
        } else if controllers.split(',').any(|name| name == "memory") {
            (&["/sys/fs/cgroup/memory"], "memory.limit_in_bytes")
        } else {
            continue;
        };
        // A group is bound by all groups around it. In a container the path may be the host's, and only the root be
        // there.
        for mount in mounts {
            for group in Path::new(path.trim_start_matches('/')).ancestors() {
                let text = read(&Path::new(mount).join(group).join(file));
                limits.extend(text.and_then(|text| text.trim().parse::<u64>().ok()));
            }
        }
    }
    limits.into_iter().filter(|&bytes| bytes > 0).min()
}

/// The number after a name at the start of a line.
fn field(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.split_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    const MEMINFO: &str = "MemTotal:       16777216 kB\nMemFree:        1 kB\n";
    const G: u64 = 1 << 30;

    /// The limit of a system that has just these files.
    fn of(files: &[(&str, &str)]) -> Option<u64> {
        limit(&|path| files.iter().find(|(name, _)| Path::new(name) == path).map(|(_, text)| (*text).to_owned()))
    }

    #[test]
    fn the_least_limit_counts() {
        assert_eq!(of(&[]), None);
        assert_eq!(of(&[("/proc/meminfo", MEMINFO)]), Some(16 * G));
        // Version 2: the group has no limit, the one around it has.
        let second = [
            ("/proc/meminfo", MEMINFO),
            ("/proc/self/cgroup", "0::/user.slice/app\n"),
            ("/sys/fs/cgroup/user.slice/app/memory.max", "max\n"),
            ("/sys/fs/cgroup/user.slice/memory.max", "3221225472\n"),
        ];
        assert_eq!(of(&second), Some(3 * G));
        // Version 1, in a container that sees its own group as the root.
        let first = [
            ("/proc/meminfo", MEMINFO),
            ("/proc/self/cgroup", "5:cpu,cpuacct:/docker/1\n4:memory:/docker/1\n0::/\n"),
            ("/sys/fs/cgroup/memory/memory.limit_in_bytes", "2147483648\n"),
        ];
        assert_eq!(of(&first), Some(2 * G));
        let unlimited = [first[0], first[1], ("/sys/fs/cgroup/memory/memory.limit_in_bytes", "9223372036854771712\n")];
        assert_eq!(of(&unlimited), Some(16 * G));
        let limits = "Limit  Soft Limit  Hard Limit  Units\nMax address space         4294967296   unlimited   bytes\n";
        assert_eq!(of(&[("/proc/meminfo", MEMINFO), ("/proc/self/limits", limits)]), Some(4 * G));
        let unlimited = limits.replace("4294967296", "unlimited");
        assert_eq!(of(&[("/proc/meminfo", MEMINFO), ("/proc/self/limits", &unlimited)]), Some(16 * G));
    }

    #[test]
    fn half_of_what_there_is_but_not_less_than_1g() {
        assert_eq!(share(None, Some(16 * G), false), 8 * G);
        assert_eq!(share(None, Some(64 * G), false), 32 * G);
        assert_eq!(share(None, Some(64 * G), true), 8 * G);
        assert_eq!(share(None, Some(G), false), G);
        assert_eq!(share(None, None, true), G);
        assert_eq!(share(Some(5 << 20), Some(16 * G), false), 5 << 20);
        assert_eq!(share(Some(1 << 50), Some(16 * G), false), 16 * G);
        assert_eq!(share(Some(1 << 50), None, false), 1 << 50);
    }

    #[test]
    fn amounts_are_short() {
        assert_eq!([text(G), text(3 << 29), text(640 << 20)], ["1.0G", "1.5G", "640M"]);
    }
}
