//! An actuator that judges what it was given: integrated here by Runge-Kutta from the equation of its mover,
//! from the shipped profile's figures. The program's own simulations are never asked.

/// The shipped profile `hapcoil_one` on 100 g, in SI units.
const MASS: f64 = 4.4e-3 * 0.1 / (4.4e-3 + 0.1);
const STIFFNESS: f64 = 702.97;
const DAMPING: f64 = 0.629;
const FORCE_FACTOR: f64 = 1.78;
const TIME_CONSTANT: f64 = 2.0;
pub const RATED: f64 = 0.1478;
const PEAK: f64 = 0.6;
const STROKE: f64 = 3e-3;
const SLEW_HZ: f64 = 2000.0;
const DC_CORNER_HZ: f64 = 5.0;

/// Share of each limit that was used; 1 is the limit itself.
#[derive(Clone, Copy, Debug, Default)]
pub struct Used {
    pub peak: f64,
    pub slew: f64,
    pub rms: f64,
    pub stroke: f64,
    pub dc: f64,
}

impl Used {
    /// Within all limits; the rms within 1 %.
    pub fn assert_within(&self, what: &str) {
        let exact = [self.peak, self.slew, self.stroke, self.dc];
        assert!(exact.iter().all(|x| *x <= 1.0 + 1e-6) && self.rms <= 1.01, "{what}: {self:?}");
    }
}

/// The coil behind 1 A at full scale.
#[derive(Clone, Debug)]
pub struct Coil {
    seconds: f64,
    place: f64,
    speed: f64,
    last: f64,
    pub heat: f64,
    area: f64,
    pub used: Used,
}

impl Coil {
    pub fn new(rate_hz: u32) -> Self {
        let seconds = 1.0 / f64::from(rate_hz);
        Self { seconds, place: 0.0, speed: 0.0, last: 0.0, heat: 0.0, area: 0.0, used: Used::default() }
    }

    /// Plays samples \[A\].
    pub fn play(&mut self, samples: impl IntoIterator<Item = f64>) -> &mut Self {
        samples.into_iter().for_each(|amps| self.step(amps));
        self
    }

    fn step(&mut self, amps: f64) {
        assert!(amps.is_finite());
        let u = &mut self.used;
        let slew = std::f64::consts::TAU * SLEW_HZ * PEAK * self.seconds;
        u.peak = u.peak.max(amps.abs() / PEAK);
        u.slew = u.slew.max((amps - self.last).abs() / slew);
        self.last = amps;
        self.heat += (amps * amps - self.heat) * self.seconds / TIME_CONSTANT;
        u.rms = u.rms.max(self.heat.sqrt() / RATED);
        self.area += amps * self.seconds;
        u.dc = u.dc.max(self.area.abs() / (8.0 * PEAK / (std::f64::consts::TAU * DC_CORNER_HZ)));
        let h = self.seconds / 4.0;
        let force = |x: f64, v: f64| (FORCE_FACTOR * amps - STIFFNESS * x - DAMPING * v) / MASS;
        for _ in 0..4 {
            let (x, v) = (self.place, self.speed);
            let k1 = (v, force(x, v));
            let k2 = (v + h / 2.0 * k1.1, force(x + h / 2.0 * k1.0, v + h / 2.0 * k1.1));
            let k3 = (v + h / 2.0 * k2.1, force(x + h / 2.0 * k2.0, v + h / 2.0 * k2.1));
            let k4 = (v + h * k3.1, force(x + h * k3.0, v + h * k3.1));
            self.place += h / 6.0 * (k1.0 + 2.0 * k2.0 + 2.0 * k3.0 + k4.0);
            self.speed += h / 6.0 * (k1.1 + 2.0 * k2.1 + 2.0 * k3.1 + k4.1);
            self.used.stroke = self.used.stroke.max(self.place.abs() / STROKE);
        }
    }

    /// Lies still and cools.
    pub fn rest(&mut self, seconds: f64) {
        self.heat *= (-seconds / TIME_CONSTANT).exp();
        (self.place, self.speed, self.last) = (0.0, 0.0, 0.0);
    }
}
