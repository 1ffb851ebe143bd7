//! Builds the library that counts a plugin's allocations, on systems that can preload it.

use std::path::PathBuf;
use std::process::Command;

fn main() {
    const SOURCE: &str = "src/commands/plugin/heap.c";
    println!("cargo:rerun-if-changed={SOURCE}");
    println!("cargo:rerun-if-env-changed=CC");
    let var = |name: &str| std::env::var(name).unwrap_or_default();
    let out = PathBuf::from(var("OUT_DIR")).join("heap.so");
    // It forwards to names that only glibc has. It is built for this machine or not at all.
    let glibc = var("CARGO_CFG_TARGET_OS") == "linux" && var("CARGO_CFG_TARGET_ENV") == "gnu";
    let built = glibc && var("TARGET") == var("HOST") && {
        let cc = std::env::var("CC").unwrap_or_else(|_| "cc".to_owned());
        let mut command = Command::new(&cc);
        command.args(["-shared", "-fPIC", "-O2", "-fno-builtin", "-o"]).arg(&out).arg(SOURCE);
        match command.status() {
            Ok(status) if status.success() => true,
            other => {
                println!("cargo:warning=`asperity plugin check` will not count allocations: {cc}: {other:?}");
                false
            }
        }
    };
    if !built {
        // An empty file stands for no library.
        std::fs::write(&out, []).expect("the build's own folder can be written to");
    }
}
