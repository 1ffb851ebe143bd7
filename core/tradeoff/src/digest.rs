//! Names of finished parts: a name says all that a part depends on, so that after a change only what it touches is run again.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use asperity_diagnostics::{file, fnv};
use asperity_graph::{GraphFile, compile};
use asperity_node::{ParamKind, ParamValue, Registry};

use crate::file::beside;
use crate::hear::over;
use crate::knob::has;
use crate::order::Order;
use crate::setting::{Base, Setting};
use crate::stroke::{Stroke, StrokeDecl};

/// Names of a setting's parts.
#[derive(Clone, Debug)]
pub(crate) struct Names {
    /// Accuracy and lag.
    pub figures: String,
    /// Hard cases.
    pub cases: String,
    /// Times, by the ratio to this default.
    pub times: String,
}

/// What a graph reads: each file's name with what is in it, in the order of their paths.
pub(crate) type Read = Vec<String>;

/// What the graphs of settings read.
pub(crate) fn read(order: &Order<'_>, settings: &[Setting], materials: &[Option<String>]) -> Vec<Read> {
    let mut files = Files::default();
    let of = |s| order.base(s).map_or_else(Read::new, |base| files.of(s, base, materials));
    settings.iter().map(of).collect()
}

/// Names of the parts of settings, the first of which is the default that all others are timed with.
pub(crate) fn names(
    order: &Order<'_>,
    settings: &[Setting],
    read: &[Read],
    played: &[Stroke],
    materials: &[Option<String>],
) -> Vec<Names> {
    let study = order.study;
    let program = format!("{} {}", order.program, order.machine.cpu);
    let strokes: Vec<String> = study.strokes.iter().map(stroke).collect();
    // How large they are made hangs on all graphs.
    let made: Vec<Option<f64>> = played.iter().map(|s| s.made_mm).collect();
    let plan = format!("{} {} {} {strokes:?} {made:?} {materials:?}", study.seed, study.draws, study.steps);
    let timed = format!("{:?} {:?} {:?}", study.times, materials.first(), order.machine);
    let mut default = None;
    let each = settings.iter().zip(read).map(|(setting, read)| {
        let own = format!("{program} {} {read:?}", setting.key);
        let default = default.get_or_insert_with(|| own.clone());
        let name = |kind: &str, of: &str| format!("{kind}-{}", of_bytes(format!("{own} {of}").as_bytes()));
        Names {
            figures: name("figures", &plan),
            cases: name("cases", ""),
            times: name("times", &format!("{timed} {default}")),
        }
    });
    each.collect()
}

/// What tells a study from another, the same in all of its shards: its settings, strokes and ways of measuring, what is in all the files that these read,
/// the version of this program. Neither the folder nor the machine, nor which build of that version, is in it.
pub(crate) fn of_all(order: &Order<'_>, settings: &[Setting], read: &[Read]) -> String {
    let study = order.study;
    let strokes: Vec<String> = study.strokes.iter().map(stroke).collect();
    let materials: Vec<&String> = study.materials.iter().map(|(name, _)| name).collect();
    let of = |(setting, read): (&Setting, &Read)| {
        // Which path comes first hangs on the folder.
        let mut read = read.clone();
        read.sort();
        format!("{} {read:?}", setting.key)
    };
    let settings: Vec<String> = settings.iter().zip(read).map(of).collect();
    let (seed, draws, steps, times) = (study.seed, study.draws, study.steps, study.times);
    let (cases, build) = (order.cases, &order.machine.build);
    let text =
        format!("{seed} {draws} {steps} {times:?} {strokes:?} {materials:?} {settings:?} {cases} {build}");
    of_bytes(text.as_bytes())
}

/// A stroke as the study declares it, with what is in its file.
fn stroke(decl: &StrokeDecl) -> String {
    let declared = decl.place.source.text().get(decl.place.span.start..decl.place.span.end);
    format!("{} {}", declared.unwrap_or_default(), decl.file().map(content).unwrap_or_default())
}

/// Largest file that is looked into, in bytes: no reader takes a larger one.
const MAX_BYTES: u64 = 5 << 30;

/// What is in a file, as a number that tells it from another; `none` of one that cannot be read.
pub fn content(path: &Path) -> String {
    file::read(path, MAX_BYTES).map_or_else(|_| "none".to_owned(), |bytes| of_bytes(&bytes))
}

/// What tells bytes from others, in hexadecimal digits.
pub(crate) fn of_bytes(bytes: &[u8]) -> String {
    format!("{:016x}", fnv(bytes))
}

/// What graphs read. Those whose nodes name the same files are asked once.
#[derive(Default)]
struct Files {
    read: HashMap<String, Read>,
    contents: HashMap<PathBuf, String>,
}

impl Files {
    fn of(&mut self, setting: &Setting, base: &Base, materials: &[Option<String>]) -> Read {
        let (named, mut all) = named(&setting.graph, &base.registry);
        let named = format!("{named} {:?}", base.plugins);
        if let Some(known) = self.read.get(&named) {
            return known.clone();
        }
        all.extend(base.plugins.iter().cloned());
        let material = materials.first().and_then(|m| m.as_deref());
        let graph = over(&setting.graph, &base.registry, material, setting.graph.seed);
        // One that does not compile is tried again anyway: errors are not kept.
        if let Ok(compiled) = compile(&graph, &base.registry, Default::default()) {
            for node in &compiled.schedule.nodes {
                all.extend(node.params.iter().filter_map(|(_, value)| match value {
                    ParamValue::File(path) => Some(path.clone()),
                    _ => None,
                }));
                all.extend(node.files.iter().cloned());
            }
        }
        all.sort();
        all.dedup();
        let of = |path: PathBuf| {
            let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
            let known = self.contents.entry(path).or_insert_with_key(|path| content(path));
            format!("{name} {known}")
        };
        let read: Read = all.into_iter().map(of).collect();
        self.read.insert(named, read.clone());
        read
    }
}

/// What nodes name that may be files, and from where; and those that are.
fn named(graph: &GraphFile, registry: &Registry) -> (String, Vec<PathBuf>) {
    let (mut text, mut files) = (String::new(), Vec::new());
    for node in &graph.nodes {
        for param in &node.params {
            if matches!(has(registry, &node.kind, &param.name), Some(ParamKind::File | ParamKind::Text)) {
                let from = param.value.place();
                text += &format!("{} {} {};", node.kind, param.value, from.source.path().display());
                files.extend(beside(&param.value).ok().filter(|path| path.is_file()));
            }
        }
    }
    (text, files)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::result::Machine;
    use crate::{Settings, Study};
    use asperity_diagnostics::Source;

    const BUILD: &str = "asperity 1";

    /// The digest of a study in a folder, of a graph that reads a trajectory, on a machine.
    fn digest(folder: &Path, (cpu, build, program): (&str, &str, &str)) -> String {
        let graph = r#"Graph(version: 1, nodes: {"s": (kind: "trajectory", params: (file: "t.csv")), "o": (kind: "probe")}, wires: [("s.position", "o")])"#;
        let graph = GraphFile::parse(&Source::new(folder.join("g.ron"), graph)).unwrap();
        let base = Base {
            name: "g".into(),
            file: graph.clone(),
            graph,
            registry: asperity_nodes::registry(),
            strength: 1.0,
            plugins: vec![folder.join("mine.so")],
        };
        let study =
            r#"Study(version: 1, strokes: [(name: "s")], grids: [(name: "g", knobs: {"tick_hz": [250]})])"#;
        let study = Study::parse(&Source::new(folder.join("s.ron"), study)).unwrap();
        let order = Order {
            study: &study,
            bases: std::slice::from_ref(&base),
            marks: &[],
            jobs: 1,
            shard: (0, 2),
            folder,
            machine: Machine { cpu: cpu.into(), cores: 2, system: "any".into(), build: build.into() },
            program,
            cases: true,
        };
        let settings = Settings::new(&study, order.bases, &[]).unwrap().all;
        of_all(&order, &settings, &read(&order, &settings, &[None]))
    }

    #[test]
    fn shards_are_of_one_study_where_all_files_say_the_same_in_whatever_folder_and_machine() {
        let dirs = [(); 2].map(|()| tempfile::tempdir().unwrap());
        let write = |of: usize, name: &str, text: &str| {
            std::fs::write(dirs[of].path().join(name), text).unwrap();
        };
        let csv = "t_s,x_mm,y_mm,z_mm\n0,0,0,-1\n1,100,0,-1\n";
        for of in 0..2 {
            write(of, "t.csv", csv);
            write(of, "mine.so", "plugin");
        }
        let here = ("cpu", BUILD, "p");
        let one = digest(dirs[0].path(), here);
        assert_eq!(digest(dirs[1].path(), ("other", BUILD, "q")), one);
        assert_ne!(digest(dirs[0].path(), ("cpu", "asperity 2", "p")), one);
        write(1, "mine.so", "another");
        assert_ne!(digest(dirs[1].path(), here), one);
        write(1, "mine.so", "plugin");
        assert_eq!(digest(dirs[1].path(), here), one);
        write(1, "t.csv", &csv.replace("100", "90"));
        assert_ne!(digest(dirs[1].path(), here), one);
    }
}
