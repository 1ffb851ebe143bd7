//! `asperity run` as a person would use it: started, listened to, and stopped.

use std::path::Path;
use std::process::{Child, Stdio};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::servers::signal;
use crate::{Ran, asperity, shipped};

/// Longest time that anything may take, also on a busy machine.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// Trials of a measurement that a busy machine may spoil.
const TRIALS: u32 = 5;

/// A sound card whose input hears its output.
pub const CARD: &str = "simulated:frames=256,loopback=1";

/// Nodes that record what the limiter lets out, and what the card plays.
pub const EARS: [&str; 2] = [
    r#""sent": (kind: "file_out", params: (file: "sent.npy")),
       "card": (kind: "audio_in", params: (unit: "A")),
       "heard": (kind: "file_out", params: (file: "heard.npy")),"#,
    r#"("limiter", "sent"), ("card", "heard"),"#,
];

/// A shipped graph with more nodes and wires, so that it can be played anywhere.
pub fn graph(name: &str, nodes: &str, wires: &str) -> String {
    let text =
        shipped(name).replacen("    },\n    wires: [", &format!("{nodes}\n    }},\n    wires: [{wires}"), 1);
    assert!(text.contains(nodes) && text.contains(wires), "{name} is not written as it was");
    text
}

/// A run under way, and what it says.
pub struct Live {
    child: Child,
    /// The output, and the error output beside it.
    out: Arc<Mutex<String>>,
    said: Arc<Mutex<String>>,
    seen: usize,
    readers: Vec<JoinHandle<()>>,
}

impl Live {
    /// Starts `asperity run`.
    pub fn start(dir: &Path, args: &[&str]) -> Self {
        Self::command(dir, &[&["run"], args].concat())
    }

    /// Starts any command of the program.
    pub fn command(dir: &Path, args: &[&str]) -> Self {
        let mut command = asperity(dir);
        command.args(args);
        Self::of(command)
    }

    /// Starts a run by this command.
    pub fn of(mut command: std::process::Command) -> Self {
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().expect("the program starts");
        let (out, said) = (Arc::<Mutex<String>>::default(), Arc::<Mutex<String>>::default());
        let readers = vec![
            listen(child.stdout.take().expect("a pipe"), vec![out.clone(), said.clone()]),
            listen(child.stderr.take().expect("a pipe"), vec![said.clone()]),
        ];
        Self { child, out, said, seen: 0, readers }
    }

    /// Its process.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Whether it has ended by itself.
    pub fn is_over(&mut self) -> bool {
        matches!(self.child.try_wait(), Ok(Some(_)))
    }

    /// Sends it a signal by its name, such as `INT`.
    pub fn signal(&self, name: &str) {
        signal(self.id(), name);
    }

    /// All that it said so far.
    pub fn said(&self) -> String {
        self.said.lock().expect("nobody panicked").clone()
    }

    /// Waits until it says something new that contains `text`; answers the rest of that line.
    pub fn says(&mut self, text: &str) -> String {
        let begun = Instant::now();
        loop {
            let said = self.said();
            let new = &said[self.seen..];
            if let Some((at, end)) = new.find(text).and_then(|at| Some((at, at + new[at..].find('\n')?))) {
                self.seen += end;
                return new[at + text.len()..end].trim().to_owned();
            }
            let over = self.is_over();
            assert!(!over && begun.elapsed() < PATIENCE, "it never said `{text}`, but: {said}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Stops it as Ctrl-C does. All that it said stands in `err`.
    pub fn stop(self) -> Ran {
        self.stop_by("INT")
    }

    /// Stops it by a signal.
    pub fn stop_by(mut self, signal: &str) -> Ran {
        assert!(!self.is_over(), "it is gone: {}", self.said());
        self.signal(signal);
        self.end()
    }

    /// Waits for its end. All that it said stands in `err`.
    pub fn end(&mut self) -> Ran {
        let code = self.child.wait().expect("it ends").code().unwrap_or(-1);
        self.readers.drain(..).for_each(|reader| reader.join().expect("it listens"));
        let out = std::mem::take(&mut *self.out.lock().expect("nobody panicked"));
        Ran { code, out, err: self.said() }
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
        if std::thread::panicking() {
            println!("the program said:\n{}", self.said());
        }
    }
}

fn listen(mut from: impl std::io::Read + Send + 'static, to: Vec<Arc<Mutex<String>>>) -> JoinHandle<()> {
    std::thread::spawn(move || {
        let mut some = [0; 4096];
        while let Ok(n @ 1..) = from.read(&mut some) {
            let text = String::from_utf8_lossy(&some[..n]);
            to.iter().for_each(|to| to.lock().expect("nobody panicked").push_str(&text));
        }
    })
}

/// A recording: one dimension of float32.
pub fn npy(file: &Path) -> Vec<f32> {
    asperity_accuracy::npy::read(file).expect("a recording").values.into_f32()
}

/// Rows of a probe's CSV, without the column of times.
pub fn rows(file: &Path) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(file).expect("a probe");
    let row = |line: &str| line.split(',').skip(1).map(|x| x.parse().unwrap_or(f64::NAN)).collect();
    text.lines().skip(1).map(row).collect()
}

/// Root of the mean square; 0 for nothing.
pub fn rms(x: &[f32]) -> f64 {
    (x.iter().map(|x| f64::from(*x) * f64::from(*x)).sum::<f64>() / x.len().max(1) as f64).sqrt()
}

/// The largest step from one sample to the next.
pub fn largest_step(samples: &[f32]) -> f32 {
    samples.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max)
}

/// Tries until a trial counts: `Err` says how a busy machine spoilt it. A wrong result panics at once.
pub fn told<T>(mut trial: impl FnMut() -> Result<T, String>) -> T {
    let mut spoilt = Vec::new();
    for _ in 0..TRIALS {
        match trial() {
            Ok(it) => return it,
            Err(why) => {
                println!("again: {why}");
                spoilt.push(why);
            }
        }
    }
    panic!("it was never to be told: {spoilt:?}");
}

/// A thread that goes on until this is dropped.
pub struct Background(Arc<AtomicBool>, Option<JoinHandle<()>>);

impl Background {
    /// Runs `run`, which looks whether it must end.
    pub fn new(run: impl FnOnce(&AtomicBool) + Send + 'static) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let seen = stop.clone();
        Self(stop, Some(std::thread::spawn(move || run(&seen))))
    }
}

impl Drop for Background {
    fn drop(&mut self) {
        self.0.store(true, Relaxed);
        let _ = self.1.take().map(JoinHandle::join);
    }
}

/// Waits for a program's end; its exit code.
pub fn end(child: &mut Child) -> i32 {
    let mut status = None;
    until("the program to end", || {
        status = child.try_wait().expect("a program");
        status.is_some()
    });
    status.and_then(|status| status.code()).unwrap_or(-1)
}

/// Waits until `is` answers true.
pub fn until(what: &str, mut is: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !is() {
        assert!(begun.elapsed() < PATIENCE, "waited too long: {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}
