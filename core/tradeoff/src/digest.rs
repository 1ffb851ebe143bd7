//! The digest of a trade-off: everything that its results depend on, but for the machine.

use std::collections::{BTreeSet, HashSet};
use std::path::{Path, PathBuf};

use asperity_diagnostics::{file, fnv};
use asperity_graph::compile;
use asperity_node::{ParamKind, ParamValue};

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
    let strokes: Vec<String> = t
        .strokes
        .iter()
        .filter_map(|s| s.file().map(|file| format!("{} {:?}", content(file), s.columns)))
        .collect();
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

pub(crate) fn of_bytes(bytes: &[u8]) -> String {
    format!("{:016x}", fnv(bytes))
}

/// Names and contents of all files that graphs read, sorted.
fn files(settings: &[Setting<'_>], material: Option<&str>) -> BTreeSet<String> {
    let (mut seen, mut paths) = (HashSet::new(), BTreeSet::new());
    for Setting { base, graph, .. } in settings {
        paths.extend(base.plugins.iter().cloned());
        // Parameters that may name files.
        let mut named = String::new();
        for (node, param) in graph.nodes.iter().flat_map(|n| n.params.iter().map(move |p| (n, p))) {
            let kind = has(&base.registry, &node.kind, &param.name);
            if matches!(kind, Some(ParamKind::File | ParamKind::Text)) {
                let from = param.value.place();
                named += &format!("{} {} {};", node.kind, param.value, from.source.path().display());
                paths.extend(param.value.path().ok().filter(|path| path.is_file()));
            }
        }
        // Compiled once for the same named files: it finds the files that these name.
        if !seen.insert(named) {
            continue;
        }
        let graph = over(graph, &base.registry, material, graph.seed);
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
        let write = |dir: usize, name: &str, text: &str| {
            std::fs::write(dirs[dir].path().join(name), text).unwrap();
        };
        for dir in 0..2 {
            write(dir, "t.csv", csv);
            write(dir, "mine.so", "plugin");
        }
        let here = ("cpu", "asperity 1", "p");
        let one = digest(dirs[0].path(), here);
        assert_eq!(digest(dirs[1].path(), ("other", "asperity 1", "q")), one);
        assert_ne!(digest(dirs[0].path(), ("cpu", "asperity 2", "p")), one);
        for (name, text, other) in
            [("mine.so", "plugin", "another"), ("t.csv", csv, &csv.replace("100", "90"))]
        {
            write(1, name, other);
            assert_ne!(digest(dirs[1].path(), here), one, "{name}");
            write(1, name, text);
            assert_eq!(digest(dirs[1].path(), here), one, "{name}");
        }
    }
}
