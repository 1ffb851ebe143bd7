//! Tells the program its commit and features, for `--version`.

use std::process::Command;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let features = std::env::var("CARGO_CFG_FEATURE").unwrap_or_default();
    let features: Vec<&str> = features.split(',').filter(|name| !matches!(*name, "" | "default")).collect();
    let features = if features.is_empty() { "none".to_owned() } else { features.join(", ") };
    // A build for development would be made anew with each commit, and its tests with it.
    let commit = match std::env::var("PROFILE").as_deref() {
        Ok("debug") => "development build".to_owned(),
        _ => commit().unwrap_or_else(|| "commit unknown: not built in git".to_owned()),
    };
    println!("cargo::rustc-env=ASPERITY_BUILD={commit}, features: {features}");
}

/// The commit of this repository; `None` outside of git, and in a repository that only holds a copy.
fn commit() -> Option<String> {
    let said = git(&["rev-parse", "--show-prefix", "--short=8", "HEAD"])?;
    let (prefix, commit) = said.split_once('\n')?;
    // These change when another commit is checked out or made.
    for name in ["HEAD", "logs/HEAD"] {
        let path = git(&["rev-parse", "--path-format=absolute", "--git-path", name])?;
        if std::path::Path::new(&path).exists() {
            println!("cargo::rerun-if-changed={path}");
        }
    }
    (prefix == "hosts/cli/").then(|| commit.to_owned())
}

fn git(args: &[&str]) -> Option<String> {
    let done = Command::new("git").args(args).output().ok().filter(|done| done.status.success())?;
    Some(String::from_utf8(done.stdout).ok()?.trim_end().to_owned())
}
