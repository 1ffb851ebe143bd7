//! Tests that must not run beside others: one at a time, or in a process of their own.

use std::path::Path;
use std::process::Command;
use std::sync::{PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

/// Set in a process that runs one test again.
const APART: &str = "ASPERITY_TEST_APART";

static TURN: RwLock<()> = RwLock::new(());

/// Waits until no other test of real time runs. The others wait until the guard is dropped.
pub fn real_time() -> RwLockWriteGuard<'static, ()> {
    TURN.write().unwrap_or_else(PoisonError::into_inner)
}

/// Runs beside others of its kind, but not beside a test that holds [`real_time`].
pub fn beside_others() -> RwLockReadGuard<'static, ()> {
    TURN.read().unwrap_or_else(PoisonError::into_inner)
}

/// A folder of a test's own, held together with its turn.
pub struct Stage<G> {
    dir: tempfile::TempDir,
    _turn: G,
}

impl<G> std::ops::Deref for Stage<G> {
    type Target = Path;

    fn deref(&self) -> &Path {
        self.dir.path()
    }
}

/// A folder, and the turn of [`real_time`].
pub fn stage() -> Stage<RwLockWriteGuard<'static, ()>> {
    Stage { dir: tempfile::tempdir().expect("a folder"), _turn: real_time() }
}

/// A folder, and the turn of [`beside_others`].
pub fn shared_stage() -> Stage<RwLockReadGuard<'static, ()>> {
    Stage { dir: tempfile::tempdir().expect("a folder"), _turn: beside_others() }
}

/// The full name of the test that asks, as `--exact` takes it.
#[macro_export]
macro_rules! test_name {
    () => {{
        fn here() {}
        $crate::alone::name_of(&here)
    }};
}

/// The path of a function within a function, without the crate and without the inner one; see [`test_name`].
pub fn name_of<F>(_: &F) -> &'static str {
    let path = std::any::type_name::<F>();
    let test = path.split_once("::").and_then(|(_, rest)| rest.strip_suffix("::here"));
    test.expect("`test_name` stands in a test's own function")
}

/// A command that runs this one test of this program again.
pub fn again(mut command: Command, test: &str) -> Command {
    command.arg(std::env::current_exe().expect("the path of this test program"));
    command.args(["--exact", test, "--nocapture", "--test-threads=1"]);
    command
}

/// Whether a program's output says that one test ran and passed. No test of that name would be a success too.
pub fn passed(output: &str) -> bool {
    output.contains("1 passed")
}

/// Runs the test again in a process of its own with these variables, after all tests that are under way.
/// `None` in that process; here all that it printed to the error output.
///
/// # Panics
///
/// Where the test fails there, or where there is no test of that name.
pub fn apart(test: &str, environment: &[(&str, &str)]) -> Option<String> {
    if std::env::var_os(APART).is_some() {
        return None;
    }
    let _turn = real_time();
    let mut child = again(Command::new("env"), test);
    child.env(APART, "1").envs(environment.iter().copied());
    let output = child.output().expect("this test runs again");
    let [out, err] = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text).into_owned());
    println!("{out}{err}");
    assert!(output.status.success() && passed(&out), "{test} failed in its own process, see above");
    Some(err)
}
