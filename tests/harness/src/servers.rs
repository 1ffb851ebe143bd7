//! Audio servers of a test's own: JACK's dummy driver, a PulseAudio null sink.
//!
//! A server is found by variables of the environment, which belong to the whole process. So a test that needs
//! one runs itself again as a child that has them set: see [`inside`]. Where a server is not installed the
//! test is skipped, loudly.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};
use std::time::{Duration, Instant};

use crate::alone::{again, passed, real_time};

/// Longest time in which a server begins or ends, also on a busy machine.
const PATIENCE: Duration = Duration::from_secs(15);

/// Message about a server that no longer calls anybody. JACK does that on a busy machine while it goes
/// into freewheel or out of it. Then another server is tried.
pub const STUCK: &str = "the server calls nobody";
/// Servers that are tried.
const SERVERS: usize = 4;

/// Set for a child that has a server in its environment: the server's process.
const INSIDE: &str = "ASPERITY_TEST_SERVER";

static COUNT: AtomicU32 = AtomicU32::new(0);

/// A name that no other test has.
fn unique(what: &str) -> String {
    format!("asperity-{what}-{}-{}", std::process::id(), COUNT.fetch_add(1, Relaxed))
}

/// Says that a test is skipped. It writes past the test harness, which would swallow the line.
pub fn skipped(why: &str) {
    let _ = writeln!(std::io::stderr(), "SKIPPED: {why}");
}

fn installed(program: &str, package: &str) -> bool {
    let found =
        Command::new(program).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok();
    if !found {
        skipped(&format!("{program} is not installed: apt-get install {package}"));
    }
    found
}

/// Sends a signal by its name, such as `INT`.
pub fn signal(pid: u32, name: &str) {
    let _ = Command::new("kill").arg(format!("-{name}")).arg(pid.to_string()).stderr(Stdio::null()).status();
}

/// Asks a server to end, and waits for that. One that has ended already may have left its number to another
/// process.
fn end(child: &mut Child) {
    if matches!(child.try_wait(), Ok(None)) {
        signal(child.id(), "TERM");
        signal(child.id(), "CONT");
        wait_for_end(child);
    }
}

/// Waits for a child to end by itself; kills it where it does not.
fn wait_for_end(child: &mut Child) {
    if !within(|| !matches!(child.try_wait(), Ok(None))) {
        let _ = child.kill();
        let _ = child.wait();
    }
}

/// Whether something becomes true within the patience.
fn within(mut is: impl FnMut() -> bool) -> bool {
    let began = Instant::now();
    while began.elapsed() < PATIENCE {
        if is() {
            return true;
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    false
}

/// A server's process, seen from the test that runs in its environment or from the one that started it.
pub struct Process(u32);

impl Process {
    /// Ends it at once (SIGKILL).
    pub fn kill(&self) {
        signal(self.0, "KILL");
    }

    /// Holds it (SIGSTOP).
    pub fn stop(&self) {
        signal(self.0, "STOP");
    }

    /// Lets it go on (SIGCONT).
    pub fn go_on(&self) {
        signal(self.0, "CONT");
    }
}

/// Starts a program with a higher priority, where that is allowed. In freewheel no JACK thread has a
/// priority, and every cycle waits for all of them: beside a build a minute of 45,000 cycles would not end.
fn first() -> Command {
    let mut command = Command::new("nice");
    command.args(["-n", "-15"]);
    command
}

/// Runs the test of that name in a child with the server in its environment, and answers None; in the child,
/// answers the server's process. The test is over for the one who gets None.
///
/// ```ignore
/// let Some(server) = inside(test_name!(), || Jack::start(48_000, 256)) else { return };
/// ```
pub fn inside<S: Server>(test: &str, start: impl Fn() -> Option<S>) -> Option<Process> {
    let _alone = real_time();
    if let Ok(pid) = std::env::var(INSIDE) {
        return Some(Process(pid.parse().expect("a process id")));
    }
    let mut told = String::new();
    for _ in 0..SERVERS {
        let success = beside(start()?, test, &mut told);
        println!("{told}");
        assert!(passed(&told) || !success, "there is no test {test} in this program");
        if success {
            return None;
        }
        if !told.contains(STUCK) {
            break;
        }
    }
    panic!("{test} failed beside its server, see above");
}

/// Runs the test beside a server; what it told, and whether it passed.
fn beside<S: Server>(mut server: S, test: &str, told: &mut String) -> bool {
    let mut child = again(first(), test);
    child.env(INSIDE, server.child().id().to_string()).envs(server.environment());
    let running = std::thread::spawn(move || child.output().expect("this test runs again"));
    // A server that is killed must not stay as a zombie: JACK would take it for one that lives.
    while !running.is_finished() {
        let _ = server.child().try_wait();
        std::thread::sleep(Duration::from_millis(5));
    }
    let output = running.join().expect("a thread that waits");
    *told = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    output.status.success()
}

/// A server that runs until this is dropped.
pub trait Server {
    /// Environment variables of a client.
    fn environment(&self) -> Vec<(&'static str, String)>;
    /// Its process.
    fn child(&mut self) -> &mut Child;
}

/// A JACK server with the dummy driver: two inputs, two outputs, synchronous.
pub struct Jack {
    child: Child,
    name: String,
    /// Keeps the name while the server runs; none for a server that comes back under one.
    claim: Option<std::fs::File>,
}

/// A name that no server has now, and what keeps it. JACK has room for eight names on a machine, and keeps
/// that of a server which was killed until another one of the same name starts: so the same few are used
/// again and again.
fn claim() -> (String, std::fs::File) {
    let began = Instant::now();
    loop {
        for n in 0..3 {
            let file = std::env::temp_dir().join(format!("asperity-jack-{n}.lock"));
            let file = std::fs::File::create(file).expect("a lock file");
            if file.try_lock().is_ok() {
                return (format!("asperity-{n}"), file);
            }
        }
        assert!(began.elapsed() < 20 * PATIENCE, "other tests run JACK all the time");
        std::thread::sleep(Duration::from_millis(100));
    }
}

/// Two JACK servers that start or end at once get into each other's way, also those of other programs.
fn turn() -> std::fs::File {
    let file = std::env::temp_dir().join("asperity-jack-turn.lock");
    let file = std::fs::File::create(file).expect("a lock file");
    file.lock().expect("a turn");
    file
}

impl Jack {
    /// Starts one and waits until its driver runs. None, with a line that says so, where JACK is not
    /// installed.
    pub fn start(rate_hz: u32, period: u32) -> Option<Self> {
        let (name, claim) = claim();
        let mut server = Self::named(&name, rate_hz, period)?;
        server.claim = Some(claim);
        Some(server)
    }

    /// The same under a name of the caller's choice: one that was used before, for a server that comes back.
    pub fn named(name: &str, rate_hz: u32, period: u32) -> Option<Self> {
        if !installed("jackd", "jackd2") {
            return None;
        }
        // With real-time scheduling where that is allowed.
        let server = Self::spawn(name, rate_hz, period, &["-R", "-P70"]);
        let server = server.or_else(|| Self::spawn(name, rate_hz, period, &["-r"]));
        Some(server.expect("jackd is installed but its dummy driver does not run"))
    }

    fn spawn(name: &str, rate_hz: u32, period: u32, scheduling: &[&str]) -> Option<Self> {
        let turn = turn();
        let (rate, period) = (rate_hz.to_string(), period.to_string());
        let mut command = first();
        command.arg("jackd");
        // A client that a busy machine keeps waiting is not thrown out.
        command.args(scheduling).args(["-n", name, "-S", "-t", "3000", "-d", "dummy"]);
        command.args(["-r", &rate, "-p", &period, "-C", "2", "-P", "2"]);
        command.env("JACK_NO_AUDIO_RESERVATION", "1").env("JACK_DEFAULT_SERVER", name);
        let child = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().ok()?;
        let mut server = Self { child, name: name.to_owned(), claim: None };
        let mut runs = false;
        within(|| {
            runs = files(name).iter().any(|path| std::os::unix::net::UnixStream::connect(path).is_ok());
            runs || !matches!(server.child.try_wait(), Ok(None))
        });
        if runs {
            return Some(server);
        }
        // Its end is another turn.
        drop(turn);
        let _ = server.child.kill();
        None
    }

    /// Its name, for `JACK_DEFAULT_SERVER`.
    pub fn name(&self) -> &str {
        &self.name
    }
}

/// Files of a JACK server of that name: its socket, its semaphores.
fn files(name: &str) -> Vec<PathBuf> {
    let entries =
        ["/dev/shm", "/tmp"].into_iter().filter_map(|folder| std::fs::read_dir(folder).ok()).flatten();
    let files = entries.flatten().map(|entry| entry.path());
    let is_its = |path: &PathBuf| {
        let file = path.file_name().map(|file| file.to_string_lossy().into_owned()).unwrap_or_default();
        file.starts_with("jack_") && file.contains(&format!("{name}_"))
    };
    files.filter(is_its).collect()
}

impl Server for Jack {
    fn environment(&self) -> Vec<(&'static str, String)> {
        vec![("JACK_DEFAULT_SERVER", self.name.clone()), ("JACK_NO_START_SERVER", "1".to_owned())]
    }

    fn child(&mut self) -> &mut Child {
        &mut self.child
    }
}

impl Drop for Jack {
    fn drop(&mut self) {
        let _turn = turn();
        end(&mut self.child);
        // What it leaves behind when it is killed.
        files(&self.name).iter().for_each(|path| drop(std::fs::remove_file(path)));
    }
}

/// A PulseAudio server with one null sink, `test`: 48 kHz, float, stereo.
pub struct Pulse {
    child: Child,
    folder: PathBuf,
}

impl Pulse {
    /// Starts one in a folder of its own and waits until it answers. None, with a line that says so, where it
    /// is not installed.
    pub fn start() -> Option<Self> {
        Self::in_folder(&std::env::temp_dir().join(unique("pulse")))
    }

    /// The same in a folder of the caller's choice: one that was used before, for a server that comes back.
    pub fn in_folder(folder: &Path) -> Option<Self> {
        if !(installed("pulseaudio", "pulseaudio") && installed("parec", "pulseaudio-utils")) {
            return None;
        }
        std::fs::create_dir_all(folder).expect("a folder for PulseAudio");
        let _ = std::fs::remove_file(folder.join("native"));
        let socket = folder.join("native");
        let native = format!("module-native-protocol-unix auth-anonymous=1 socket={}", socket.display());
        let sink = "module-null-sink sink_name=test rate=48000 format=float32le channels=2 norewinds=1";
        let mut command = Command::new("pulseaudio");
        command.args([
            "-n",
            "--daemonize=no",
            "--exit-idle-time=-1",
            "--use-pid-file=no",
            "--log-level=error",
        ]);
        command.args(["-L", &native, "-L", sink]).envs(Self::variables(folder));
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        let child = command.spawn().ok()?;
        let server = Self { child, folder: folder.to_owned() };
        let answers = within(|| std::os::unix::net::UnixStream::connect(&socket).is_ok());
        assert!(answers, "pulseaudio is installed but does not answer");
        Some(server)
    }

    fn variables(folder: &Path) -> Vec<(&'static str, String)> {
        let place = folder.display().to_string();
        let server = format!("unix:{}", folder.join("native").display());
        vec![
            ("XDG_RUNTIME_DIR", place.clone()),
            ("PULSE_RUNTIME_PATH", place.clone()),
            ("HOME", place),
            ("PULSE_SERVER", server),
        ]
    }
}

impl Server for Pulse {
    fn environment(&self) -> Vec<(&'static str, String)> {
        Self::variables(&self.folder)
    }

    fn child(&mut self) -> &mut Child {
        &mut self.child
    }
}

impl Drop for Pulse {
    fn drop(&mut self) {
        end(&mut self.child);
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

/// A recording of the null sink, by `parec` of the server in the environment.
pub struct Parec {
    child: Child,
    file: PathBuf,
}

impl Parec {
    /// Begins to record, and waits until something has come.
    pub fn start() -> Self {
        let file = std::env::temp_dir().join(unique("parec"));
        let mut command = Command::new("parec");
        command.args(["-d", "test.monitor", "--raw", "--format=float32le", "--rate=48000", "--channels=2"]);
        command.args(["--latency-msec=20"]).arg(&file).stderr(Stdio::null());
        let child = command.spawn().expect("parec starts");
        let records = within(|| std::fs::metadata(&file).is_ok_and(|about| about.len() > 0));
        assert!(records, "parec records nothing");
        Self { child, file }
    }

    /// Ends, and answers what was recorded: frames of two channels.
    pub fn stop(mut self) -> Vec<[f32; 2]> {
        signal(self.child.id(), "INT");
        wait_for_end(&mut self.child);
        let bytes = std::fs::read(&self.file).unwrap_or_default();
        let frames = bytes.chunks_exact(8).map(|frame| {
            let sample =
                |at: usize| f32::from_le_bytes([frame[at], frame[at + 1], frame[at + 2], frame[at + 3]]);
            [sample(0), sample(4)]
        });
        frames.collect()
    }
}

impl Drop for Parec {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
        let _ = std::fs::remove_file(&self.file);
    }
}
