//! How late a graph answers the hand: the same line and the same numbers in every command.

use std::fmt;
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::time::Duration;

use asperity_graph::{GraphFile, Schedule};
use asperity_node::{Latency, Registry};
use asperity_tradeoff::Chain;
use serde::{Serialize, Serializer};
use serde_json::{Value, json};

use crate::load::without_force;

/// Steps of speed. More make the level of a random texture more certain: with 24, lags of a graph with six
/// seeds lay between 7.3 and 9.8 ms, with 148 between 7.7 and 9.1, and took 0.4 and 2.6 s.
const STEPS: usize = 32;
/// Longest time for a measurement beside other work.
const PATIENCE: Duration = Duration::from_secs(10);

/// Response lag and declared latency of a graph. Its text is the line for people.
#[derive(Clone, Debug)]
pub struct Lag {
    /// Milliseconds after a step of speed until the level has gone 10, 50 and 90 % of its way, or why there
    /// are none.
    pub measured: Result<[f64; 3], String>,
    /// Sum of the declared latencies on the slowest path.
    pub declared_ms: f64,
    /// Nodes of the slowest path.
    slowest_path: Vec<String>,
    /// Nodes that delay samples on it.
    late: Vec<String>,
}

/// Writes the numbers with the line.
///
/// # Errors
/// Those of the serializer.
pub fn with_line<S: Serializer>(lag: &Lag, to: S) -> Result<S::Ok, S::Error> {
    json(lag).serialize(to)
}

/// The numbers and the line, for a report.
pub fn json(lag: &Lag) -> Value {
    json!({
        "line": lag.to_string(), "response_lag_ms": lag.measured.as_ref().ok(),
        "not_measured": lag.measured.as_ref().err(), "declared_ms": lag.declared_ms,
        "slowest_path": lag.slowest_path, "late": lag.late,
    })
}

impl Lag {
    /// Measures a graph. Its nodes are prepared once more, and follow a stroke with steps of speed.
    pub fn of(graph: &GraphFile, registry: &Registry, schedule: &Schedule) -> Self {
        let (graph, registry) = (without_force(graph, registry), registry.clone());
        let (to, from) = sync_channel(1);
        // A node that hangs does not hold the command.
        let thread = std::thread::Builder::new().name("asperity-lag".into()).spawn(move || {
            let chain = Chain::stepped(&graph, &registry);
            let _ = to.send(chain.map_err(|e| e.message).and_then(|mut chain| measure(&mut chain)));
        });
        let told = match thread.map(|_| from.recv_timeout(PATIENCE)) {
            Ok(Ok(told)) => told,
            Ok(Err(RecvTimeoutError::Timeout)) => {
                Err(format!("it takes more than {} s; see `asperity latency`", PATIENCE.as_secs()))
            }
            _ => Err("the measurement failed".to_owned()),
        };
        Self::new(told, schedule)
    }

    /// Joins a measured response lag, or the reason why there is none, with the declared latency.
    pub fn new(measured: Result<[f64; 3], String>, schedule: &Schedule) -> Self {
        let path = schedule.slowest();
        let nodes = path.through.iter().map(|&i| &schedule.nodes[i]);
        let late = nodes.clone().filter(|node| node.latency > Latency::ZERO);
        let late = late.map(|node| node.id.clone()).collect();
        let slowest_path = nodes.map(|node| node.id.clone()).collect();
        Self { measured, declared_ms: path.latency.ms(), slowest_path, late }
    }
}

impl fmt::Display for Lag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.measured {
            Ok([_, half, _]) => write!(f, "response lag {half:.0} ms from the hand")?,
            Err(why) => write!(f, "response lag not measured ({why})")?,
        }
        write!(f, "; declared latency {:.1} ms", self.declared_ms)?;
        if let (Some(first), Some(last)) = (self.slowest_path.first(), self.slowest_path.last()) {
            write!(f, " on the slowest path, `{first}` to `{last}`")?;
        }
        if !self.late.is_empty() {
            write!(f, " by `{}`", self.late.join("`, `"))?;
        }
        Ok(())
    }
}

/// Response lag \[ms\] of a prepared chain: 10, 50 and 90 % of a step of speed.
///
/// # Errors
/// Why it has none.
pub fn measure(chain: &mut Chain) -> Result<[f64; 3], String> {
    if chain.output().is_none() {
        return Err("nothing here is an acceleration, a current or a voltage at the audio rate".to_owned());
    }
    let rises = chain.lag_ms(0, STEPS);
    rises.ok_or_else(|| "the level does not rise with speed, so no answer to a step of it can be seen".into())
}
