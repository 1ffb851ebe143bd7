//! The committed header is the one that is generated from this crate.

use std::path::Path;

#[test]
fn committed_header_is_current() {
    let dir = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(dir.join("cbindgen.toml")).expect("the configuration");
    let bindings = cbindgen::Builder::new().with_crate(dir).with_config(config).generate().expect("a header");
    let mut text = Vec::new();
    bindings.write(&mut text);
    // Headings are for Rust's documentation.
    let generated = String::from_utf8(text).expect("UTF-8").replace("// # Safety\n", "");
    let path = dir.join("include/asperity.h");
    if std::env::var_os("ASPERITY_WRITE_HEADER").is_some() {
        std::fs::write(&path, &generated).expect("it is written");
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(committed == generated, "{} is stale; write it anew with: make header", path.display());
}

#[test]
fn version_of_the_header_is_the_package_s() {
    let version =
        [crate::ASPERITY_VERSION_MAJOR, crate::ASPERITY_VERSION_MINOR, crate::ASPERITY_VERSION_PATCH];
    assert_eq!(version.map(|part| part.to_string()).join("."), env!("CARGO_PKG_VERSION"));
}
