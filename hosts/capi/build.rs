//! Names the shared library by its interface, so that a program never loads one that it was not built for.

use std::env::var;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    let part = |name: &str| var(format!("CARGO_PKG_VERSION_{name}")).unwrap_or_default();
    if var("CARGO_CFG_TARGET_OS").is_ok_and(|os| os == "linux") {
        // Before 1.0, each minor version has an interface of its own.
        let (major, minor) = (part("MAJOR"), part("MINOR"));
        let version = if major == "0" { format!("0.{minor}") } else { major };
        println!("cargo:rustc-cdylib-link-arg=-Wl,-soname,libasperity.so.{version}");
    }
}
