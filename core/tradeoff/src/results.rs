//! Results of a trade-off, as the JSON file has them.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::figure::{Figure, Figures};

/// Version of the file. Older files of this version lack newer figures, and use the aliases below.
pub(crate) const VERSION: u32 = 2;

/// Results of a trade-off.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Results {
    /// Version of the format: 2.
    pub version: u32,
    /// Path of the trade-off file, as it was given.
    #[serde(alias = "study")]
    pub tradeoff: String,
    /// Digest of settings, strokes, materials, input files and ways of measuring.
    pub digest: String,
    /// Seed of the first draw.
    pub seed: u64,
    /// Strokes, each with its length.
    pub strokes: Vec<String>,
    /// Names of the materials.
    pub materials: Vec<String>,
    /// Machines that measured.
    pub machines: Vec<Machine>,
    /// Shards in these results, as number from 1 and count: `[(1, 1)]` for a run that was not split.
    pub shards: Vec<(usize, usize)>,
    /// Settings that are not finished, since the run was stopped.
    pub unfinished: usize,
    /// Hard cases that settings were put to; 0 with `--no-cases`.
    pub cases: usize,
    /// Noise floor of each figure: smaller differences are not significant.
    #[serde(alias = "floor")]
    pub noise_floor: Figures,
    /// Noise floor of the response lag \[ms\].
    #[serde(alias = "lag_floor_ms")]
    pub lag_noise_floor_ms: Option<f64>,
    /// Noise floor of the load, as a ratio: 1.05 for 5 %.
    #[serde(alias = "load_floor")]
    pub load_noise_floor: Option<f64>,
    /// Figures of the network's own magnitudes in the first default: a reference. Nodes behind the network
    /// may pass it, by chance or by correcting its errors.
    pub model: Figures,
    /// Time of an idle tick that spins for the default's median. Anything beyond that is the machine's.
    #[serde(alias = "empty")]
    pub idle: Option<Time>,
    /// Warnings about how the results were measured.
    #[serde(default)]
    pub notes: Vec<String>,
    /// All settings.
    pub rows: Vec<Row>,
}

/// A machine that measured.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Machine {
    /// Name of the processor.
    pub cpu: String,
    /// Available cores.
    pub cores: usize,
    /// Operating system and architecture.
    pub system: String,
    /// Version of this program, and whether it was built without optimisation.
    pub build: String,
}

/// Results of a setting.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Row {
    /// Name: the changed knobs, `default`, or the name of a baseline.
    pub name: String,
    /// Unique key.
    pub key: String,
    /// Path of its graph, as it was given.
    pub graph: String,
    /// Changed knobs with their values.
    pub turned: Vec<(String, String)>,
    /// Names of the grids that contain it.
    pub grids: Vec<String>,
    /// Whether it is an unchanged graph.
    pub default: bool,
    /// Whether it is a baseline.
    #[serde(alias = "mark")]
    pub baseline: bool,
    /// Tick rate \[Hz\].
    pub tick_hz: u32,
    /// Differences from the graph's file.
    pub fragment: Fragment,
    /// Why it did not run.
    pub error: Option<String>,
    /// Figures of accuracy: means over the draws.
    pub figures: Figures,
    /// Figures of each draw.
    pub draws: Vec<Figures>,
    /// Response lag \[ms\]: from a step of speed until the level is 10, 50 and 90 % of the way.
    pub lag_ms: Option<[f64; 3]>,
    /// 50 % response lag of each draw \[ms\].
    pub lag_draws_ms: Vec<f64>,
    /// Declared latency \[ms\].
    pub latency_ms: Option<f64>,
    /// Faults of its nodes: over the strokes, in the steps of speed and during timing.
    pub faults: u64,
    /// Hard cases that it was put to.
    pub cases: usize,
    /// Hard cases that it fails, each with the finding.
    pub fails: BTreeMap<String, String>,
    /// Its times.
    pub time: Option<Time>,
}

/// Differences from a graph's file, as RON.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fragment {
    /// Fields of the graph, such as `tick_hz`.
    pub graph: Vec<String>,
    /// New and changed entries of `nodes`.
    pub nodes: Vec<String>,
    /// Ids of removed nodes.
    pub gone: Vec<String>,
    /// All entries of `wires`, where any differs.
    pub wires: Vec<String>,
    /// Kinds of these nodes from plugins that the file does not name, with the names of the plugins.
    pub plugins: Vec<(String, String)>,
    /// Whether the file is a scene: then this belongs into the graph that it lowers to.
    pub scene: bool,
}

/// Times of a setting, in microseconds unless the name says otherwise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Time {
    /// Median of a tick.
    pub p50_us: f64,
    /// 99th percentile.
    pub p99_us: f64,
    /// 99.9th percentile.
    pub p999_us: f64,
    /// Maximum.
    pub max_us: f64,
    /// Deadline misses: ticks that took longer than a tick lasts.
    pub misses: u64,
    /// Timed ticks.
    pub ticks: u64,
    /// Load \[%\]: median time of a block of ticks over the block's length. Settings are ranked by it, since
    /// medians of single ticks do not compare between tick rates, or with nodes that run in every n-th tick.
    /// A block lasts 8 ms or more, a whole number of the periods of all nodes.
    pub load_percent: f64,
    /// Largest deviation of a turn's load from the median, as a ratio.
    pub spread: f64,
    /// Median of the first tick of a turn, after other settings used the caches.
    pub cold_us: f64,
    /// Share of the machine's own stalls in the 99.9th percentile, estimated from idle ticks.
    pub stall_us: f64,
    /// Memory of nodes and buffers \[KiB\], where it can be counted. Models, weights and libraries that a
    /// process holds once for all graphs are not in it.
    pub memory_kib: Option<f64>,
    /// Faults of its nodes during timing.
    #[serde(default)]
    pub faults: u64,
}

impl Row {
    /// Whether it may be chosen: it ran, it was timed, no node failed, and it fails no hard case.
    pub fn sound(&self) -> bool {
        self.error.is_none() && self.time.is_some() && self.faults == 0 && self.fails.is_empty()
    }

    /// Whether it was timed, or cannot be.
    pub fn is_finished(&self) -> bool {
        self.time.is_some() || self.error.is_some()
    }

    /// Load \[% of real time\].
    pub fn load(&self) -> Option<f64> {
        self.time.map(|t| t.load_percent)
    }

    /// A figure.
    pub fn figure(&self, figure: Figure) -> Option<f64> {
        self.figures.get(&figure).copied()
    }

    /// 50 % response lag \[ms\].
    pub fn lag50(&self) -> Option<f64> {
        self.lag_ms.map(|l| l[1])
    }
}

impl Results {
    /// Reads results from their JSON text.
    ///
    /// # Errors
    /// Invalid JSON, another version.
    pub fn parse(text: &str) -> Result<Self, String> {
        let none = |e: serde_json::Error| format!("these are no results of `asperity tradeoff`: {e}");
        let value: serde_json::Value = serde_json::from_str(text).map_err(none)?;
        match value.get("version").and_then(serde_json::Value::as_u64) {
            Some(version) if version != u64::from(VERSION) => Err(format!(
                "these results have version {version}, and this program reads version {VERSION}: \
                 run the trade-off again"
            )),
            _ => serde_json::from_value(value).map_err(none),
        }
    }

    /// Missing shards, from 1.
    pub fn missing_shards(&self) -> Vec<usize> {
        let of = self.shards.iter().map(|s| s.1).max().unwrap_or(1);
        (1..=of).filter(|number| !self.shards.iter().any(|s| s.0 == *number)).collect()
    }

    /// The default of the first graph.
    pub fn default_row(&self) -> Option<&Row> {
        self.rows.iter().find(|r| r.default)
    }

    /// Whether any setting has a figure.
    pub fn knows(&self, figure: Figure) -> bool {
        self.rows.iter().any(|row| row.figure(figure).is_some())
    }

    /// Whether two values of a figure differ by more than the noise floor.
    pub fn differ(&self, figure: Figure, a: f64, b: f64) -> bool {
        (a - b).abs() > self.noise_floor.get(&figure).copied().unwrap_or(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{measured, results};

    #[test]
    fn older_results_lack_newer_figures_and_have_old_names() {
        let mut all = results(vec![measured("old", 1.0, 0.5, 20.0)]);
        all.rows[0].figures.insert(Figure::Modulation, 2.0);
        let mut text = serde_json::to_string(&all).unwrap();
        assert_eq!(Results::parse(&text).unwrap().rows[0].figure(Figure::Modulation), Some(2.0));
        let e = Results::parse(&text.replacen(r#""version":2"#, r#""version":1"#, 1)).unwrap_err();
        assert!(e.contains("version 1") && e.contains("run the trade-off again"), "{e}");
        for (new, old) in [
            (r#""modulation":2.0,"#, ""),
            (r#""tradeoff":"#, r#""study":"#),
            (r#""baseline":"#, r#""mark":"#),
            (r#""noise_floor":"#, r#""floor":"#),
            (r#""lag_noise_floor_ms":"#, r#""lag_floor_ms":"#),
            (r#""load_noise_floor":"#, r#""load_floor":"#),
            (r#""idle":"#, r#""empty":"#),
        ] {
            assert!(text.contains(new), "{new}");
            text = text.replace(new, old);
        }
        let old = Results::parse(&text).unwrap();
        assert!(old.tradeoff == "s.ron" && !old.knows(Figure::Modulation));
        assert_eq!(old.usual(), [Figure::Level]);
    }
}
