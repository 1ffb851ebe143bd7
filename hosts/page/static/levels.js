// How strong a setting is under the hand: mean square of its acceleration, by the speed and force of the stroke. Two
// settings are compared where both were stroked alike.

/// Slower or softer than this is no stroke.
const [LEAST_MM_S, LEAST_N] = [10, 0.05];

export class Levels {
  /// So much of a like stroke is enough.
  static ENOUGH_S = 1.5;
  /// Seconds of strokes.
  seconds = 0;
  /// Seconds and sums of power by bins of half an octave of speed and an octave of force.
  #bins = new Map();

  copy() {
    const copy = new Levels();
    copy.seconds = this.seconds;
    copy.#bins = new Map([...this.#bins].map(([bin, all]) => [bin, { ...all }]));
    return copy;
  }

  /** New samples of a stroke, played at a strength. */
  take(strength, speed, force, acceleration, rate) {
    if (!speed.length || !acceleration.length || strength < 0.02) return;
    const mean = (list) => list.reduce((sum, x) => sum + x, 0) / list.length;
    const [v, n] = [mean(speed), force.length ? mean(force) : 1];
    if (v < LEAST_MM_S || n < LEAST_N) return;
    const bin = `${Math.round(2 * Math.log2(v))} ${Math.round(Math.log2(n))}`;
    if (!this.#bins.has(bin)) this.#bins.set(bin, { seconds: 0, power: 0 });
    const all = this.#bins.get(bin);
    const seconds = acceleration.length / rate;
    const square = acceleration.reduce((sum, x) => sum + x * x, 0) / acceleration.length;
    all.seconds += seconds;
    all.power += (square / strength ** 2) * seconds;
    this.seconds += seconds;
  }

  /** Seconds in which both were stroked alike. */
  alike(other) {
    return this.#shared(other).reduce((sum, { weight }) => sum + weight, 0);
  }

  /** How much louder this is than the other at full strength, in dB; null before there is enough to tell. */
  against(other) {
    if (this.alike(other) < Levels.ENOUGH_S) return null;
    const [mine, its] = this.#shared(other).reduce(
      ([mine, its], { a, b, weight }) => [mine + (weight * a.power) / a.seconds, its + (weight * b.power) / b.seconds],
      [0, 0],
    );
    return mine > 0 && its > 0 ? 10 * Math.log10(mine / its) : null;
  }

  #shared(other) {
    return [...this.#bins].flatMap(([bin, a]) => {
      const b = other.#bins.get(bin);
      return b ? [{ a, b, weight: Math.min(a.seconds, b.seconds) }] : [];
    });
  }
}
