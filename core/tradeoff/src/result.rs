//! What came of a study, as its JSON file has it.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::figure::{Figure, Figures};

/// Version of the file. A figure that an older file of this version does not have is absent.
pub(crate) const VERSION: u32 = 2;

/// Results of a study.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Results {
    /// [`VERSION`].
    pub version: u32,
    /// The study's file, as it was named.
    pub study: String,
    /// What tells its settings, strokes, materials and ways of measuring from those of another study.
    pub digest: String,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Strokes and materials, in words.
    pub strokes: Vec<String>,
    /// Materials.
    pub materials: Vec<String>,
    /// What ran it.
    pub machines: Vec<Machine>,
    /// Shards that are in these results, from 1, and of how many: `[(1, 1)]` where the study was not split.
    /// Each was timed against the first default.
    pub shards: Vec<(usize, usize)>,
    /// Settings that are not finished: the study was stopped, or a shard is missing and nobody knows its
    /// settings.
    pub unfinished: usize,
    /// Hard cases that settings were put to; 0 where nobody looked.
    pub cases: usize,
    /// Figures that differ by less than this between two settings are not told apart.
    pub floor: Figures,
    /// The same of response lags \[ms\].
    pub lag_floor_ms: Option<f64>,
    /// The same of loads, as a ratio: 1.05 for 5 %.
    pub load_floor: Option<f64>,
    /// Figures of the network's own magnitudes in the first default: a reference, which what is behind the
    /// network may pass by chance or by making up for its errors.
    pub model: Figures,
    /// Time of a tick in which nothing is done, for as long as the median of the default's: what is beyond
    /// that is the machine's own.
    pub empty: Option<Time>,
    /// What a person should know of how they were taken.
    #[serde(default)]
    pub notes: Vec<String>,
    /// All settings.
    pub rows: Vec<Row>,
}

/// What ran a study.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Machine {
    /// The processor as it calls itself.
    pub cpu: String,
    /// Cores that could be used.
    pub cores: usize,
    /// Operating system and architecture.
    pub system: String,
    /// Version of this program, and whether it was built to be fast.
    pub build: String,
}

/// What came of a setting.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Row {
    /// What it is called.
    pub name: String,
    /// What tells it from every other.
    pub key: String,
    /// The graph it was made of, as it was named.
    pub graph: String,
    /// Knobs that were turned, and to what.
    pub turned: Vec<(String, String)>,
    /// Grids that it stands in.
    pub grids: Vec<String>,
    /// Whether it is its graph as it stands.
    pub default: bool,
    /// Whether it stands beside the others under a name of its own.
    pub mark: bool,
    /// Ticks a second.
    pub tick_hz: u32,
    /// Nodes and wires that differ from the graph's, as RON to be pasted.
    pub fragment: Fragment,
    /// Why it could not be run.
    pub error: Option<String>,
    /// Figures of accuracy.
    pub figures: Figures,
    /// The same of every draw.
    pub draws: Vec<Figures>,
    /// Response lag: ms from a step of speed until the level is 10, 50, 90 % of the way.
    pub lag_ms: Option<[f64; 3]>,
    /// The 50 % of every draw.
    pub lag_draws_ms: Vec<f64>,
    /// Declared latency \[ms\].
    pub latency_ms: Option<f64>,
    /// How often nodes failed: over the strokes, in the steps of speed and while it was timed.
    pub faults: u64,
    /// Hard cases that it was put to.
    pub cases: usize,
    /// Hard cases that do not hold, and what was found.
    pub fails: BTreeMap<String, String>,
    /// What it takes.
    pub time: Option<Time>,
}

/// What differs from a graph's file, as RON.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fragment {
    /// `tick_hz` and such.
    pub graph: Vec<String>,
    /// Entries of `nodes`.
    pub nodes: Vec<String>,
    /// Ids of nodes that are gone.
    pub gone: Vec<String>,
    /// Entries of `wires`, where any differ: all of them.
    pub wires: Vec<String>,
    /// Kinds of these nodes that are of plugins which the file does not name, and the plugins' names, as
    /// they are looked for along the plugin path.
    pub plugins: Vec<(String, String)>,
    /// Whether the file is a scene, so that all this is of the graph that it lowers to.
    pub scene: bool,
}

/// What a setting takes, in microseconds unless it says otherwise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Time {
    /// Median of a tick.
    pub p50_us: f64,
    /// 99th percentile.
    pub p99_us: f64,
    /// 99.9th percentile.
    pub p999_us: f64,
    /// The longest.
    pub max_us: f64,
    /// Ticks that took longer than a tick lasts.
    pub misses: u64,
    /// Ticks that were timed.
    pub ticks: u64,
    /// Median time of a length of signal over this length, in per cent: what is ranked, since ticks of
    /// other rates, and nodes that run in some of them, have medians that do not compare. The length is
    /// [`LOAD_MS`](crate::time::LOAD_MS) or more, a whole number of the periods of all nodes.
    pub load_percent: f64,
    /// Largest difference of a turn's load from that, as a ratio.
    pub spread: f64,
    /// The first tick after others had the caches: the median over turns.
    pub cold_us: f64,
    /// What of the 99.9th percentile the machine stalls by itself: what ticks that did nothing, in the same
    /// turns, took beyond their median, at the percentile where they had met as many stalls.
    pub stall_us: f64,
    /// Memory that the graph takes \[KiB\], where it can be counted: its nodes and its buffers, beyond the
    /// models, weights and libraries that a process has once for all of its graphs.
    pub memory_kib: Option<f64>,
    /// How often nodes failed while it was timed.
    #[serde(default)]
    pub faults: u64,
}

impl Row {
    /// Whether it may be chosen: it ran, its time is known, no node failed, and every hard case that it was
    /// put to holds.
    pub fn sound(&self) -> bool {
        self.error.is_none() && self.time.is_some() && self.faults == 0 && self.fails.is_empty()
    }

    /// Whether there is nothing left to do for it: its time is known, or why there is none.
    pub fn is_finished(&self) -> bool {
        self.time.is_some() || self.error.is_some()
    }

    /// Its load in per cent of real time.
    pub fn load(&self) -> Option<f64> {
        self.time.map(|t| t.load_percent)
    }

    /// A figure.
    pub fn figure(&self, figure: Figure) -> Option<f64> {
        self.figures.get(&figure).copied()
    }

    /// Its median lag in ms.
    pub fn lag50(&self) -> Option<f64> {
        self.lag_ms.map(|l| l[1])
    }
}

impl Results {
    /// Results from their JSON text.
    ///
    /// # Errors
    /// A text that is none, or of another version.
    pub fn parse(text: &str) -> Result<Self, String> {
        #[derive(Deserialize)]
        struct Versioned {
            version: u32,
        }
        let none = |e: serde_json::Error| format!("these are no results of `asperity tradeoff`: {e}");
        let Versioned { version } = serde_json::from_str(text).map_err(none)?;
        if version != VERSION {
            return Err(format!(
                "these results are of version {version}, and this program reads version {VERSION}: run the study again"
            ));
        }
        serde_json::from_str(text).map_err(none)
    }

    /// Shards that are missing, from 1.
    pub fn missing_shards(&self) -> Vec<usize> {
        let of = self.shards.iter().map(|s| s.1).max().unwrap_or(1);
        (1..=of).filter(|number| !self.shards.iter().any(|s| s.0 == *number)).collect()
    }

    /// The default of the first graph.
    pub fn default_row(&self) -> Option<&Row> {
        self.rows.iter().find(|r| r.default)
    }

    /// Whether two values of a figure are told apart.
    pub fn differ(&self, figure: Figure, a: f64, b: f64) -> bool {
        (a - b).abs() > self.floor.get(&figure).copied().unwrap_or(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{measured, results};

    #[test]
    fn results_of_before_a_figure_are_read_without_it() {
        let mut all = results(vec![measured("old", 1.0, 0.5, 20.0)]);
        all.rows[0].figures.insert(Figure::Modulation, 2.0);
        let text = serde_json::to_string(&all).unwrap();
        assert_eq!(Results::parse(&text).unwrap().rows[0].figure(Figure::Modulation), Some(2.0));
        let old = Results::parse(&text.replace(r#""modulation":2.0,"#, "")).unwrap();
        assert!(old.rows[0].figure(Figure::Modulation).is_none() && !old.knows(Figure::Modulation));
        assert_eq!(old.usual(), [Figure::Level]);
        let e = Results::parse(&text.replacen(r#""version":2"#, r#""version":1"#, 1)).unwrap_err();
        assert!(e.contains("version 1") && e.contains("run the study again"), "{e}");
    }
}
