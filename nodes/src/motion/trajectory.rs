//! `trajectory`: a recorded stroke.

use std::sync::Arc;

use crate::prelude::*;
use asperity_diagnostics::Source;
use asperity_motion::{AxisMap, ColumnMap, Cursor, Interpolation, TrajectoryOptions};
use asperity_node::NodeKind;

use super::microseconds;

/// The stroke that is played where a graph names no file: a zigzag with a pause and a lift-off.
const SHIPPED: &str = include_str!("../../../graphs/trajectories/zigzag.csv");

/// Plays a table of positions and, where recorded, forces and speeds.
/// [`asperity_motion::Trajectory::parse`] explains how missing positions are replaced.
pub struct Trajectory {
    trajectory: asperity_motion::Trajectory,
    cursor: Cursor,
}

impl Node for Trajectory {
    fn descriptor() -> Descriptor {
        Descriptor::new("trajectory", "Plays a recorded stroke from a CSV file, interpolated at each tick.")
            .role(Role::Stroke)
            .output(control_out("position", 3, MM).doc("stylus position x, y, z; z points up"))
            .output(control_out("force", 1, N))
            .doc("recorded normal force; needs the column force_n")
            .output(control_out("speed", 1, MM_S))
            .doc("recorded speed; needs the column speed_mm_s")
            .output(control_out("stroke", 1, ONE))
            .doc("number of the stroke, from the column stroke; 0 without it")
            .param(file("file").optional().doc(
                "CSV file with the stroke; left out, a shipped zigzag. Columns: t_s, x_mm, y_mm, z_mm, and \
                 force_n, speed_mm_s and stroke if recorded. Rows may be irregular in time. Where the \
                 number of the stroke changes, a jump is no motion. Without z_mm, force_n \
                 presses into a floor of 0.5 N/mm. Without x_mm and y_mm, speed_mm_s is the speed of a \
                 straight line along x.",
            ))
            .param(texts("map"))
            .doc("Columns with other names, and their units: [\"t_s=time:ms\", \"force_n=Fz:N\"].")
            .param(text("axes", "x,y,z"))
            .doc(
                "The file's axes that become x, y and z. For a device whose vertical axis is y: \
                 \"x,-z,y\".",
            )
            .param(
                choice("interpolation", &["cubic", "linear"]).doc("Interpolation of positions between rows."),
            )
            .param(number("max_gap_s", 0.0, 0.0..=3600.0, "s"))
            .doc("Longest gap between rows that is accepted. 0: 0.1 s, or five median steps if longer.")
            .param(Param::flag("loop", false, ""))
            .doc("Repeats the stroke. From its end to its start, the stylus moves in the air, in 0.9 s.")
            .resumes(Resume::Continue)
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        if setup.params.get("file").is_some() {
            return Self::of(&Source::read(setup.params.file("file"))?, setup);
        }
        Self::of(&Source::new("trajectories/zigzag.csv (shipped)", SHIPPED), setup)
    }
}

impl Trajectory {
    /// The same kind, whose nodes play a stroke that the host has: the text of a CSV file.
    pub fn playing(stroke: Arc<Source>) -> NodeKind {
        NodeKind::new(Self::descriptor(), move |setup| Self::of(&stroke, setup))
    }

    fn of(stroke: &Arc<Source>, setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let p = setup.params;
        let axes = AxisMap::parse(p.text("axes")).map_err(|e| error_at(p, "axes", e))?;
        let linear = p.text("interpolation") == "linear";
        let max_gap_s = Some(p.number("max_gap_s")).filter(|s| *s > 0.0);
        let interpolation = if linear { Interpolation::Linear } else { Interpolation::Cubic };
        let columns = ColumnMap::parse(p.texts("map")).map_err(|e| error_at(p, "map", e))?;
        let options = TrajectoryOptions { columns, axes, max_gap_s, interpolation };
        let trajectory = asperity_motion::Trajectory::parse(stroke, &options)?;
        let recorded =
            [("force", trajectory.has_force(), "force_n"), ("speed", trajectory.has_speed(), "speed_mm_s")];
        for (output, (name, there, column)) in recorded.iter().enumerate() {
            if setup.outputs[1 + output].connected && !there {
                let message =
                    format!("`{}.{name}` is wired, but the file has no column `{column}`", setup.id);
                return Err(p.error("file", message).help("record it, or compute it with other nodes"));
            }
        }
        let duration = (!p.flag("loop")).then(|| microseconds(trajectory.duration_s()));
        let trajectory = if duration.is_none() { trajectory.repeated() } else { trajectory };
        Ok(Prepared::new(Self { trajectory, cursor: Cursor::default() }).duration(duration))
    }
}

impl Processor for Trajectory {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let sample = self.trajectory.sample_from(&mut self.cursor, tick.seconds());
        tick.outputs.control(0).copy_from_slice(&sample.position);
        tick.outputs.set(1, sample.force.unwrap_or(0.0));
        tick.outputs.set(2, sample.speed.unwrap_or(0.0));
        tick.outputs.set(3, sample.stroke.unwrap_or(0.0));
        Status::Continue
    }

    fn reset(&mut self) {
        self.cursor = Cursor::default();
    }

    fn facts(&mut self) -> Vec<Fact> {
        let mut facts = vec![
            Fact::count("rows", self.trajectory.rows() as u64),
            Fact::number("duration", self.trajectory.duration_s(), "s"),
        ];
        let ignored = self.trajectory.ignored();
        if !ignored.is_empty() {
            facts.push(Fact::text("ignored_columns", ignored.join(", ")));
        }
        facts
    }
}
