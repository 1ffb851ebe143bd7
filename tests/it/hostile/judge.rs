//! Rules that every case must keep, and the count of cases.

use std::collections::BTreeMap;
use std::fs;
use std::io::Read;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use harness::Room;

/// Processor time that a case may take \[s\]: a clock would measure the machine's other work, too.
const MOST_CPU_S: u64 = 60;
/// Who takes longer hangs.
const LONGEST: Duration = Duration::from_secs(900);
/// Memory that a case may take with its budget: the program itself and the files that it reads.
const BUDGET: &str = "1GiB";
const MOST_MIB: u64 = 1500;

/// Factor on the usual number of cases.
pub fn times() -> u64 {
    std::env::var("ASPERITY_HOSTILE").ok().and_then(|n| n.parse().ok()).unwrap_or(1)
}

/// Numbers that follow from a seed (SplitMix64).
pub struct Seed(pub u64);

impl Seed {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Below `n`, which is above 0.
    pub fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    pub fn of<'a, T>(&mut self, all: &'a [T]) -> &'a T {
        &all[self.below(all.len())]
    }
}

/// End of a run.
pub struct Ended {
    pub status: ExitStatus,
    pub said: String,
    pub took: Duration,
    pub peak_mib: u64,
}

/// All that comes out of a pipe.
fn listen(pipe: Option<impl Read + Send + 'static>) -> std::thread::JoinHandle<String> {
    std::thread::spawn(move || {
        let mut said = Vec::new();
        let _ = pipe.map(|mut pipe| pipe.read_to_end(&mut said));
        String::from_utf8_lossy(&said).into_owned()
    })
}

/// Runs a command to its end, or for so long.
pub fn ends(mut command: Command, longest: Duration) -> Result<Ended, String> {
    let began = Instant::now();
    // A group of its own, so that children end with it.
    command.process_group(0).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().map_err(|e| format!("it does not start: {e}"))?;
    let (errors, answer) = (child.stderr.take(), child.stdout.take());
    let readers = (listen(errors), listen(answer));
    let pid = child.id() as libc::pid_t;
    loop {
        let (mut status, mut usage) = (0, std::mem::MaybeUninit::<libc::rusage>::zeroed());
        // SAFETY: a child of this process that nobody else waits for, and room for both answers.
        let gone = unsafe { libc::wait4(pid, &mut status, libc::WNOHANG, usage.as_mut_ptr()) } == pid;
        if gone {
            // SAFETY: wait4 filled it; zeros are a value of it too.
            let peak_mib = unsafe { usage.assume_init() }.ru_maxrss as u64 / 1024;
            let status = ExitStatus::from_raw(status);
            return Ok(Ended {
                status,
                said: readers.0.join().unwrap_or_default() + &readers.1.join().unwrap_or_default(),
                took: began.elapsed(),
                peak_mib,
            });
        }
        if began.elapsed() > longest {
            // SAFETY: the group that was made above.
            unsafe { libc::kill(-pid, libc::SIGKILL) };
            let _ = child.wait();
            return Err(format!("it did not end within {} s", longest.as_secs()));
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Every file below a folder.
fn files(dir: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    for entry in fs::read_dir(dir).into_iter().flatten().flatten() {
        let (path, kind) = (entry.path(), entry.file_type().expect("a kind"));
        if kind.is_dir() {
            all.extend(files(&path));
        } else if kind.is_file() && entry.metadata().is_ok_and(|m| m.len() < 1 << 24) {
            all.insert(path.clone(), fs::read(path).unwrap_or_default());
        }
    }
    all
}

/// Results of a family of cases.
#[derive(Default)]
pub struct Tally {
    name: &'static str,
    counts: Mutex<Counts>,
}

#[derive(Default)]
struct Counts {
    codes: [u64; 3],
    slowest: Duration,
    largest_mib: u64,
    failed: Vec<String>,
}

impl Tally {
    pub fn new(name: &'static str) -> Self {
        Self { name, ..Self::default() }
    }

    /// Runs a case in its folder, in which nothing but `outputs` may change.
    pub fn case(&self, case: &str, dir: Room, mut command: Command, outputs: &[&str]) {
        command.args(["--memory", BUDGET]);
        let (line, before) = (format!("{command:?}"), files(&dir));
        harness::most_cpu_s(&mut command, MOST_CPU_S);
        let verdict = ends(command, LONGEST)
            .and_then(|ended| judged(&ended, &dir, &before, &files(&dir), outputs).map(|code| (code, ended)));
        self.count(case, dir, &line, verdict);
    }

    /// Counts what another judge found.
    pub fn count(
        &self,
        case: &str,
        dir: Room,
        command: &impl std::fmt::Debug,
        verdict: Result<(usize, Ended), String>,
    ) {
        let mut counts = self.counts.lock().expect("nobody panicked");
        match verdict {
            Ok((code, ended)) => {
                counts.codes[code] += 1;
                counts.slowest = counts.slowest.max(ended.took);
                counts.largest_mib = counts.largest_mib.max(ended.peak_mib);
            }
            Err(why) => {
                let kept = dir.keep();
                let line = format!("{} {case}: {why}\n    in {}: {command:?}", self.name, kept.display());
                counts.failed.push(line.chars().take(2000).collect());
            }
        }
    }

    /// Says how many there were, and fails where one did.
    pub fn done(self) {
        let Counts { codes: [done, machine, refused], slowest, largest_mib, failed } =
            self.counts.into_inner().expect("nobody panicked");
        let all = done + machine + refused + failed.len() as u64;
        println!(
            "{}: {all} cases, {refused} refused, {done} accepted, {machine} errors of the machine, \
             {} wrong; at most {:.1} s, {largest_mib} MiB",
            self.name,
            failed.len(),
            slowest.as_secs_f64()
        );
        assert!(
            failed.is_empty(),
            "{} cases went wrong:\n{}",
            failed.len(),
            failed[..failed.len().min(10)].join("\n")
        );
        assert!(all > 0, "no case was run");
    }
}

/// The exit code of a run that went as it must.
fn judged(
    ended: &Ended,
    dir: &Path,
    before: &BTreeMap<PathBuf, Vec<u8>>,
    after: &BTreeMap<PathBuf, Vec<u8>>,
    outputs: &[&str],
) -> Result<usize, String> {
    let said: String = ended.said.chars().take(600).collect();
    let code = match ended.status.code() {
        Some(code @ 0..=2) => code as usize,
        Some(code) => return Err(format!("exit code {code}: {said}")),
        None => return Err(format!("ended by {}: {said}", ended.status)),
    };
    if ended.said.contains("panicked") {
        return Err(format!("it panicked: {said}"));
    }
    // A check that finds something says which case fails.
    if code != 0 && !["error", "fail"].iter().any(|word| ended.said.contains(word)) {
        return Err(format!("exit code {code}, and no error is told: {said}"));
    }
    if ended.peak_mib > MOST_MIB {
        return Err(format!("it took {} MiB", ended.peak_mib));
    }
    let is_output = |path: &Path| outputs.iter().any(|output| dir.join(output) == path);
    for (path, bytes) in before.iter().filter(|(path, _)| !is_output(path) || code != 0) {
        if after.get(path) != Some(bytes) {
            return Err(format!("exit code {code}, and {} is not what it was", path.display()));
        }
    }
    let new = after.keys().find(|path| {
        let part = path.to_string_lossy().ends_with(".part") || path.to_string_lossy().ends_with(".renames");
        part || (code != 0 && !before.contains_key(*path))
    });
    match new {
        Some(path) => Err(format!("exit code {code}, and it left {}: {said}", path.display())),
        None => Ok(code),
    }
}

/// Runs cases two at a time.
pub fn two_at_a_time(count: u64, case: impl Fn(u64) + Sync) {
    std::thread::scope(|s| {
        s.spawn(|| (1..count).step_by(2).for_each(&case));
        (0..count).step_by(2).for_each(&case);
    });
}

/// Programs that do what no case may do.
#[test]
fn program_that_does_wrong_is_found_out() {
    let wrong = |script: &str| {
        let dir = Room::new();
        fs::write(dir.join("precious"), "mine").expect("a file");
        let before = files(&dir);
        let mut command = Command::new("sh");
        command.args(["-c", script]).current_dir(&dir);
        let ended = ends(command, Duration::from_secs(2))?;
        judged(&ended, &dir, &before, &files(&dir), &["out"])
    };
    assert_eq!(wrong("exit 0"), Ok(0));
    assert_eq!(wrong("echo error >&2; exit 2"), Ok(2));
    assert_eq!(wrong("echo new > out"), Ok(0));
    for (script, why) in [
        ("exit 101", "exit code 101"),
        ("kill -SEGV $$", "ended by signal"),
        ("echo thread panicked >&2", "it panicked"),
        ("exit 2", "no error is told"),
        ("echo other > precious", "is not what it was"),
        ("rm precious", "is not what it was"),
        ("echo half > .out.abcdef.part", "it left"),
        ("echo error >&2; echo half > out; exit 1", "it left"),
        ("sleep 60", "did not end within 2 s"),
    ] {
        let found = wrong(script);
        assert!(found.as_ref().is_err_and(|e| e.contains(why)), "{script}: {found:?}");
    }
}
