//! The machine's file: actuator and amplifier behind each channel of a device. No graph can raise its
//! limits.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use asperity_actuator::{ActuatorProfile, Drive, Dynamics, Limiter, LimiterSettings};
use asperity_diagnostics::ron::{Value, parse};
use asperity_diagnostics::{Diagnostic, Place, Source};
use asperity_graph::{Schedule, ScheduledNode};
use asperity_live::{Opened, OutputLimits};
use asperity_node::{Guard, Unit};

use crate::load::inverse_of;

/// Relative difference of numbers that count as equal.
const SAME: f64 = 1e-6;

#[derive(Clone, Debug)]
pub struct Machine {
    pub source: Arc<Source>,
    pub outputs: Vec<Output>,
    /// Place of the list of outputs.
    pub list: Place,
}

/// Actuator and amplifier behind one channel of a device.
#[derive(Clone, Debug)]
pub struct Output {
    pub device: String,
    pub channel: u16,
    pub actuator: Dynamics,
    /// Name of its profile, or the path of the file.
    pub profile: String,
    pub handle_mass_g: f64,
    /// Peak volts of the card at full scale.
    pub volts_at_full_scale: f64,
    /// Current amplifier \[A/V\], or voltage amplifier \[V/V\].
    pub amplifier: (Drive, f64),
    /// Most volts that the card may put out.
    pub most_volts: f64,
    pub place: Place,
}

/// The file in the user's configuration folder; `None` if the system has no such folder.
pub fn default_path() -> Option<PathBuf> {
    Some(dirs::config_dir()?.join("asperity").join("machine.ron"))
}

impl Machine {
    /// Reads the named file; else the user's own, if it exists.
    pub fn find(named: Option<&Path>) -> Result<Option<Self>, Diagnostic> {
        let there = |path: &PathBuf| !matches!(path.try_exists(), Ok(false));
        let path = named.map(Path::to_path_buf).or_else(|| default_path().filter(there));
        path.map(|path| Self::read(&path)).transpose()
    }

    pub fn read(path: &Path) -> Result<Self, Diagnostic> {
        Self::parse(&Source::read(path)?)
    }

    pub fn parse(source: &Arc<Source>) -> Result<Self, Diagnostic> {
        let root = parse(source)?;
        let mut record = root.record("Machine")?;
        let version = record.required("version")?;
        if version.i64()? != 1 {
            return Err(version.error("this version is not known").help("write `version: 1`"));
        }
        let list = record.required("outputs")?;
        record.finish()?;
        let base = source.path().parent().unwrap_or(Path::new(""));
        let mut outputs: Vec<Output> = Vec::new();
        for value in list.list()? {
            let new = output(value, base)?;
            if let Some(first) = outputs.iter().find(|o| o.device == new.device && o.channel == new.channel) {
                let what = format!("channel {} of `{}` is described twice", new.channel, new.device);
                let place = &first.place;
                return Err(new.error(what).related(&place.source, place.span, "first here"));
            }
            outputs.push(new);
        }
        Ok(Self { source: source.clone(), outputs, list: list.place() })
    }

    pub fn output(&self, device: &Opened, channel: u16) -> Option<&Output> {
        self.outputs_of(device, channel).next()
    }

    /// The entry for a channel of the device with this name.
    pub fn named(&self, device: &str, channel: u16) -> Option<&Output> {
        self.outputs.iter().find(|o| o.device == device && o.channel == channel)
    }

    /// Entries that name a channel, by the device's id or by its name.
    fn outputs_of<'m>(&'m self, device: &Opened, channel: u16) -> impl Iterator<Item = &'m Output> {
        let short = device.name.rsplit_once(" (").map_or("", |(name, _)| name).to_owned();
        let names = [device.id.clone(), device.name.clone(), short];
        self.outputs.iter().filter(move |o| o.channel == channel && names.contains(&o.device))
    }

    /// Refuses a graph that contradicts the file. `playing` are its nodes by channel.
    pub fn check(
        &self,
        device: &Opened,
        playing: &[(u16, String)],
        schedule: &Schedule,
    ) -> Result<(), Diagnostic> {
        for (channel, id) in playing {
            let mut entries = self.outputs_of(device, *channel);
            if let (Some(first), Some(second)) = (entries.next(), entries.next()) {
                let message = format!("two entries are about channel {channel} of `{}`", device.name);
                let place = &first.place;
                return Err(second.error(message).related(&place.source, place.span, "the other one"));
            }
            let node = schedule.index_of(id).map(|i| &schedule.nodes[i]);
            if let (Some(output), Some(node)) = (self.output(device, *channel), node) {
                output.check(node, schedule)?;
            }
        }
        Ok(())
    }

    pub fn limits(&self, device: &Opened, rate_hz: u32) -> Result<OutputLimits, Diagnostic> {
        let guard = |(channel, _): &(u16, String)| {
            self.output(device, *channel).map(|output| output.guard(rate_hz)).transpose()
        };
        Ok(OutputLimits::staying(device.channels.iter().map(guard).collect::<Result<Vec<_>, _>>()?))
    }
}

impl Output {
    /// Guard of the channel, and the drive at full scale \[A or V\].
    fn guard(&self, rate_hz: u32) -> Result<(Box<dyn Guard>, f64), Diagnostic> {
        let (drive, gain) = self.amplifier;
        let mut actuator = self.actuator;
        let most = self.most_volts * gain;
        match drive {
            Drive::Current => actuator.peak_current = actuator.peak_current.min(most),
            Drive::Voltage => actuator.peak_voltage = actuator.peak_voltage.min(most),
        }
        let limiter = Limiter::new(&actuator, drive, f64::from(rate_hz), LimiterSettings::default())
            .map_err(|e| self.error(e.to_string()))?;
        Ok((Box::new(limiter.guard()), gain * self.volts_at_full_scale))
    }

    fn error(&self, message: String) -> Diagnostic {
        Diagnostic::new(message).at(&self.place.source, self.place.span)
    }

    /// Refuses a node that plays on this channel and contradicts the entry.
    fn check(&self, out: &ScheduledNode, schedule: &Schedule) -> Result<(), Diagnostic> {
        let amps = out.inputs.first().and_then(|i| i.port.as_ref()).is_some_and(|p| p.unit == Unit::AMPERE);
        let (drive, gain) = self.amplifier;
        let (name, unit) = if amps { ("amps_per_volt", "A/V") } else { ("volts_per_volt", "V/V") };
        if amps != (drive == Drive::Current) {
            let (graph, machine) = if amps { ("current", "voltage") } else { ("voltage", "current") };
            let id = &out.id;
            let what = format!("`{id}` plays a {graph}, and a {machine} amplifier stands behind its channel");
            return Err(self.contradicts(out, "", what).help(self.follow(out, schedule)));
        }
        for (name, is, unit) in [("volts_at_full_scale", self.volts_at_full_scale, "V"), (name, gain, unit)] {
            let (said, id) = (out.params.number(name), &out.id);
            if differ(said, is) {
                let what = format!("`{id}.{name}` is {said} {unit}, and the machine's file says {is} {unit}");
                return Err(self.contradicts(out, name, what).help(self.follow(out, schedule)));
            }
        }
        let limiter = limiter_of(out, schedule);
        let checked = limiter.map_or(Ok(()), |limiter| self.check_actuator(limiter));
        checked.map_err(|e| e.help(self.follow(out, schedule)))
    }

    fn follow(&self, out: &ScheduledNode, schedule: &Schedule) -> String {
        let (file, at) = (self.place.source.path().display(), self.place.position());
        format!("to follow {file}:{}:{}:{}", at.line, at.column, self.options(out, schedule))
    }

    /// Options with which a graph follows this entry, each behind a space.
    pub fn options(&self, out: &ScheduledNode, schedule: &Schedule) -> String {
        let (drive, gain) = match self.amplifier {
            (Drive::Current, gain) => ("current", ("amps_per_volt", gain)),
            (Drive::Voltage, gain) => ("voltage", ("volts_per_volt", gain)),
        };
        let numbers = [("volts_at_full_scale", self.volts_at_full_scale), gain];
        let of = |node: &ScheduledNode, (name, is): (&str, f64)| {
            let said = node.params.get_number(name);
            said.is_some_and(|said| differ(said, is)).then(|| (format!("{}.{name}", node.id), is.to_string()))
        };
        let mut settings: Vec<_> = numbers.into_iter().filter_map(|number| of(out, number)).collect();
        let limiter = limiter_of(out, schedule);
        let inverse = limiter.and_then(|limiter| inverse_of(limiter, schedule));
        if let Some(inverse) = inverse.filter(|inverse| inverse.params.text("drive") != drive) {
            settings.push((format!("{}.drive", inverse.id), drive.to_owned()));
        }
        for node in inverse.into_iter().chain(limiter) {
            if node.params.text("profile") != self.profile {
                settings.push((format!("{}.profile", node.id), self.profile.clone()));
            }
            settings.extend(of(node, ("handle_mass_g", self.handle_mass_g)));
        }
        let set = |(name, is): (String, String)| {
            let word = format!("{name}={is}");
            if word.contains([' ', '\'']) { format!(" --set {word:?}") } else { format!(" --set {word}") }
        };
        settings.into_iter().map(set).collect()
    }

    /// Refuses a limiter for another actuator, or with higher limits.
    fn check_actuator(&self, limiter: &ScheduledNode) -> Result<(), Diagnostic> {
        let base = limiter.params.place("profile").or(limiter.params.node_place());
        let base = base.and_then(|p| p.source.path().parent()).unwrap_or(Path::new(""));
        let profile = ActuatorProfile::find(limiter.params.text("profile"), base)?;
        let said = Dynamics::new(&profile, limiter.params.number("handle_mass_g"))
            .map_err(|e| limiter.params.node_error(e.to_string()))?;
        let (is, id) = (&self.actuator, &limiter.id);
        let same = [
            ("handle mass", said.handle_mass, is.handle_mass, "kg"),
            ("moving mass", said.moving_mass, is.moving_mass, "kg"),
            ("stiffness", said.stiffness, is.stiffness, "N/m"),
            ("damping", said.damping, is.damping, "N s/m"),
            ("force factor", said.force_factor, is.force_factor, "N/A"),
            ("resistance", said.resistance, is.resistance, "ohm"),
            ("inductance", said.inductance, is.inductance, "H"),
            ("thermal time constant", said.thermal_time_constant, is.thermal_time_constant, "s"),
        ];
        for (what, said, is, unit) in same {
            if differ(said, is) {
                let param = if what == "handle mass" { "handle_mass_g" } else { "profile" };
                let (said, is) = (rounded(said), rounded(is));
                let what = format!(
                    "the {what} of `{id}`'s actuator is {said} {unit}, \
                     which is not that of the machine's file, {is} {unit}"
                );
                return Err(self.contradicts(limiter, param, what));
            }
        }
        let most = [
            ("rated current", said.rated_current, is.rated_current, "A"),
            ("peak current", said.peak_current, is.peak_current, "A"),
            ("peak voltage", said.peak_voltage, is.peak_voltage, "V"),
            ("stroke", said.stroke, is.stroke, "m"),
        ];
        for (what, said, is, unit) in most {
            if said > is * (1.0 + SAME) {
                let (said, is) = (rounded(said), rounded(is));
                let what = format!(
                    "the {what} of `{id}`'s actuator is {said} {unit}, \
                     above that of the machine's file, {is} {unit}"
                );
                return Err(self.contradicts(limiter, "profile", what));
            }
        }
        let own = LimiterSettings::default();
        let (slew_hz, dc_hz) = (limiter.params.number("slew_hz"), limiter.params.number("dc_corner_hz"));
        let laxer = [
            ("slew_hz", slew_hz, slew_hz > own.slew_hz * (1.0 + SAME), "above", own.slew_hz),
            ("dc_corner_hz", dc_hz, dc_hz < own.dc_corner_hz * (1.0 - SAME), "below", own.dc_corner_hz),
        ];
        if let Some((param, said, _, side, is)) = laxer.into_iter().find(|(_, _, laxer, ..)| *laxer) {
            let what = format!("`{id}.{param}` is {said} Hz, {side} the {is} Hz that hold on this machine");
            return Err(self.contradicts(limiter, param, what));
        }
        Ok(())
    }

    fn contradicts(&self, node: &ScheduledNode, param: &str, message: String) -> Diagnostic {
        let at = self.place.position();
        let file = self.place.source.path().display();
        node.params
            .error(param, message)
            .related(&self.place.source, self.place.span, "entry in the machine's file")
            .help(format!(
                "{file}:{}:{} describes channel {} of `{}`; correct the graph, or that file",
                at.line, at.column, self.channel, self.device
            ))
    }
}

fn differ(said: f64, is: f64) -> bool {
    (said - is).abs() > SAME * is
}

/// The limiter before an output.
fn limiter_of<'s>(out: &ScheduledNode, schedule: &'s Schedule) -> Option<&'s ScheduledNode> {
    out.inputs.first().and_then(|i| i.from).map(|(node, _)| &schedule.nodes[node])
}

/// A number for a text, without the noise of its last digits.
fn rounded(x: f64) -> f64 {
    format!("{x:.8e}").parse().unwrap_or(x)
}

fn output(value: &Value, base: &Path) -> Result<Output, Diagnostic> {
    let mut record = value.record("")?;
    let device = record.required("device")?.text()?.to_owned();
    let channel = record.required("channel")?.i64_in(1..=4096, "")? as u16;
    let profile = record.required("profile")?;
    let handle = record.required("handle_mass_g")?;
    let volts_at_full_scale = record.required("volts_at_full_scale")?.f64_in(1e-3..=100.0, "V")?;
    let amps = record.optional("amps_per_volt");
    let volts = record.optional("volts_per_volt");
    let most = record.optional("most_volts");
    let amplifier = match (amps, volts) {
        (Some(gain), None) => (Drive::Current, gain.f64_in(1e-3..=100.0, "A/V")?),
        (None, Some(gain)) => (Drive::Voltage, gain.f64_in(1e-3..=1000.0, "V/V")?),
        _ => {
            return Err(value
                .error("the amplifier is missing")
                .help("amps_per_volt: of a current amplifier; or volts_per_volt: of a voltage amplifier"));
        }
    };
    let most_volts = most.map_or(Ok(volts_at_full_scale), |v| v.f64_in(1e-3..=100.0, "V"))?;
    record.finish()?;
    let found = ActuatorProfile::find(profile.text()?, base).map_err(|d| {
        if d.path().is_some() { d } else { profile.error(d.message).help(d.help.unwrap_or_default()) }
    })?;
    let handle_mass_g = handle.f64_in(1.0..=10_000.0, "g")?;
    let actuator = Dynamics::new(&found, handle_mass_g).map_err(|e| handle.error(e.to_string()))?;
    let mut profile = profile.text()?.to_owned();
    if profile.ends_with(".ron") {
        profile = base.join(profile).display().to_string();
    }
    let place = value.place();
    Ok(Output {
        device,
        channel,
        actuator,
        profile,
        handle_mass_g,
        volts_at_full_scale,
        amplifier,
        most_volts,
        place,
    })
}
