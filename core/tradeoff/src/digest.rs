//! The digest of a trade-off: everything that its results depend on, but for the machine.

use std::collections::{BTreeSet, HashSet};
use std::path::{Path, PathBuf};

use asperity_diagnostics::{file, fnv};
use asperity_graph::{GraphFile, compile};
use asperity_node::{ParamKind, ParamValue, Registry};

use crate::chain::over;
use crate::knob::has;
use crate::results::Fragment;
use crate::run::Job;
use crate::setting::{LoadedGraph, Setting};

/// Digest of the trade-off, its graphs, input files, ways of measuring and the version of this program. It is
/// the same in all shards: folder, machine and build are not in it.
pub(crate) fn of_all(job: &Job<'_>, settings: &[Setting<'_>], material: Option<&str>) -> String {
    let t = job.tradeoff;
    let graph = |b: &LoadedGraph| {
        format!("{} {} {:?}", b.strength, b.file.source.text(), Fragment::between(b, &b.graph))
    };
    let graphs: Vec<String> = job.bases.iter().chain(job.baselines).map(graph).collect();
    let strokes: Vec<String> = t.strokes.iter().filter_map(|s| s.file().map(content)).collect();
    let ways = (t.seed, t.lenient, settings.len(), job.cases, &job.machine.build);
    let files = files(settings, material);
    of_bytes(format!("{ways:?} {} {graphs:?} {strokes:?} {files:?}", t.source.text()).as_bytes())
}

/// Largest input file \[bytes\]: no reader takes a larger one.
const MAX_BYTES: u64 = 5 << 30;

/// Digest of a file's content; `none` where it cannot be read.
pub fn content(path: &Path) -> String {
    file::read(path, MAX_BYTES).map_or_else(|_| "none".to_owned(), |bytes| of_bytes(&bytes))
}

/// Digest of bytes, in hexadecimal digits.
pub(crate) fn of_bytes(bytes: &[u8]) -> String {
    format!("{:016x}", fnv(bytes))
}

/// Names and contents of all files that graphs read, sorted.
fn files(settings: &[Setting<'_>], material: Option<&str>) -> BTreeSet<String> {
    let (mut seen, mut paths) = (HashSet::new(), BTreeSet::new());
    for setting in settings {
        let base = setting.base;
        paths.extend(base.plugins.iter().cloned());
        let (named, files) = named(&setting.graph, &base.registry);
        // Compiled once for the same named files: it finds the files that these name.
        if !seen.insert(named) {
            continue;
        }
        paths.extend(files);
        let graph = over(&setting.graph, &base.registry, material, setting.graph.seed);
        let Ok(compiled) = compile(&graph, &base.registry, Default::default()) else { continue };
        for node in &compiled.schedule.nodes {
            paths.extend(node.params.iter().filter_map(|(_, value)| match value {
                ParamValue::File(path) => Some(path.clone()),
                _ => None,
            }));
            paths.extend(node.files.iter().cloned());
        }
    }
    let name = |path: &PathBuf| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    paths.iter().map(|path| format!("{} {}", name(path), content(path))).collect()
}

/// Parameters that may name files, as text, and the files that exist.
fn named(graph: &GraphFile, registry: &Registry) -> (String, Vec<PathBuf>) {
    let (mut text, mut files) = (String::new(), Vec::new());
    for node in &graph.nodes {
        for param in &node.params {
            if matches!(has(registry, &node.kind, &param.name), Some(ParamKind::File | ParamKind::Text)) {
                let from = param.value.place();
                text += &format!("{} {} {};", node.kind, param.value, from.source.path().display());
                files.extend(param.value.path().ok().filter(|path| path.is_file()));
            }
        }
    }
    (text, files)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::setting::Settings;
    use crate::testing::{graph_of, job, loaded, tradeoff};

    /// The digest in a folder, on a machine, of a graph that reads a trajectory.
    fn digest(folder: &Path, (cpu, build, program): (&str, &str, &str)) -> String {
        let nodes = r#""s": (kind: "trajectory", params: (file: "t.csv")), "o": (kind: "probe")"#;
        let path = |name: &str| folder.join(name).display().to_string();
        let graph = graph_of(&path("g.ron"), nodes, r#"("s.position", "o")"#);
        let base = LoadedGraph { plugins: vec![folder.join("mine.so")], ..loaded("g", graph) };
        let grids = r#"strokes: [(name: "s")], grids: [(name: "g", knobs: {"tick_hz": [250]})]"#;
        let tradeoff = tradeoff(&path("s.ron"), grids);
        let mut job = job(&tradeoff, std::slice::from_ref(&base), folder);
        (job.machine.cpu, job.machine.build, job.program) = (cpu.into(), build.into(), program);
        let settings = Settings::new(&tradeoff, job.bases, &[]).unwrap().all;
        of_all(&job, &settings, None)
    }

    #[test]
    fn digest_depends_on_files_and_version_only() {
        let dirs = [(); 2].map(|()| tempfile::tempdir().unwrap());
        let csv = "t_s,x_mm,y_mm,z_mm\n0,0,0,-1\n1,100,0,-1\n";
        let write = |name: &str, text: &str| std::fs::write(dirs[1].path().join(name), text).unwrap();
        std::fs::write(dirs[0].path().join("t.csv"), csv).unwrap();
        std::fs::write(dirs[0].path().join("mine.so"), "plugin").unwrap();
        write("t.csv", csv);
        write("mine.so", "plugin");
        let here = ("cpu", "asperity 1", "p");
        let one = digest(dirs[0].path(), here);
        assert_eq!(digest(dirs[1].path(), ("other", "asperity 1", "q")), one);
        assert_ne!(digest(dirs[0].path(), ("cpu", "asperity 2", "p")), one);
        write("mine.so", "another");
        assert_ne!(digest(dirs[1].path(), here), one);
        write("mine.so", "plugin");
        assert_eq!(digest(dirs[1].path(), here), one);
        write("t.csv", &csv.replace("100", "90"));
        assert_ne!(digest(dirs[1].path(), here), one);
    }
}
