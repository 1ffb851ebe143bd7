// Plays the acceleration on the speakers or headphones of this device. Samples are scheduled block by block: that works
// on a plain address of a local network too, where there is no AudioWorklet.
import { figure, write } from "./draw.js";

/// Where the soft clip begins [m/s²]. With the volume at its start, 2 m/s² rms plays at -38 dB of full scale, and nothing
/// above -24 dB.
const CLIP_M_S2 = 10;
const VOLUME = "asperity.volume";
/// Least and most time that samples wait before they are played, and at first [s].
const [LEAST_S, MOST_S, FIRST_S] = [0.03, 0.4, 0.06];
/// After so long without an underrun the wait becomes shorter.
const CALM_S = 8;
/// Fades at the ends of a stretch without gaps [s].
const FADE_S = 0.004;
/// A block is made shorter or longer by at most this part, to keep the wait.
const BEND = 0.004;

export class Listen {
  #link;
  #button = document.getElementById("listen");
  #volume = document.getElementById("volume");
  #text = document.getElementById("heard");
  #context = null;
  #gate = null;
  #gain = null;
  #rate = 0;
  /// Time of the context at which the next block begins, and the sample that it begins with.
  #at = 0;
  #next = null;
  #ahead = FIRST_S;
  #least = Infinity;
  #calm = 0;
  #late = null;

  /// Counts for a person, and for tests.
  scheduled = 0;
  underruns = 0;

  constructor(link) {
    this.#link = link;
    this.#volume.value = localStorage.getItem(VOLUME) ?? this.#volume.value;
    this.#volume.addEventListener("input", () => {
      localStorage.setItem(VOLUME, this.#volume.value);
      this.#loud();
    });
    this.#button.addEventListener("click", () => (this.#context ? this.#end() : this.#begin()));
  }

  /** The end of the chain, to look at what is played. */
  get output() {
    return this.#gain;
  }

  #begin() {
    this.#open(this.#rate || 48000);
    this.#button.setAttribute("aria-pressed", "true");
    write(this.#button, "Listening");
  }

  #end() {
    this.#context?.close();
    this.#context = null;
    this.#button.setAttribute("aria-pressed", "false");
    write(this.#button, "Listen");
    write(this.#text, "Plays the vibration on this device's speakers or headphones.");
  }

  /** A context of the run's own rate: the browser resamples to that of the device. */
  #open(rate) {
    this.#context?.close();
    const context = new AudioContext({ sampleRate: rate, latencyHint: "interactive" });
    const clip = new WaveShaperNode(context, { curve: Float32Array.from({ length: 2049 }, (_, i) => Math.tanh((i - 1024) / 512) / 2) });
    // The curve spans -1 to 1: twice where it begins to bend.
    const scale = new GainNode(context, { gain: 1 / CLIP_M_S2 / 2 });
    this.#gate = new GainNode(context, { gain: 0 });
    this.#gain = new GainNode(context, { gain: 0 });
    this.#gate.connect(scale).connect(clip).connect(this.#gain).connect(context.destination);
    this.#context = context;
    this.#next = null;
    this.#ahead = FIRST_S;
    this.scheduled = this.underruns = 0;
    this.#loud();
    context.resume();
  }

  /** The volume: in equal steps for the ear. */
  #loud() {
    if (!this.#context) return;
    const part = Number(this.#volume.value) / 100;
    this.#gain.gain.setTargetAtTime(part ? 10 ** (1.5 * (part - 1)) : 0, this.#context.currentTime, 0.02);
  }

  /** Another layout counts its samples anew. */
  restart() {
    this.#next = null;
  }

  /** New samples of the acceleration; `first` counts them since the layout. `seconds` is the time of the run. */
  take(first, samples, rate, seconds) {
    this.#rate = rate;
    const context = this.#context;
    if (!context || !samples.length) return;
    if (context.sampleRate !== rate) this.#open(rate);
    if (context.state !== "running") return this.restart();
    const now = context.currentTime;
    this.#delays(performance.now() / 1000 - seconds);
    const late = this.#next !== null && this.#at < now;
    if (late) {
      this.underruns += 1;
      this.#ahead = Math.min(MOST_S, this.#ahead * 1.5);
      this.#calm = now;
    }
    const whole = this.#next === first && !late;
    if (late || this.#next === null) this.#at = Math.max(this.#at, now + this.#ahead);
    if (this.#at > now + 2 * MOST_S) this.#at = now + this.#ahead;
    const slack = this.#at - now;
    this.#least = Math.min(this.#least, slack);
    if (now - this.#calm > CALM_S) {
      // The wait was longer than it had to be all the while.
      if (this.#least > LEAST_S) this.#ahead = Math.max(LEAST_S, this.#ahead - this.#least / 4);
      [this.#least, this.#calm] = [Infinity, now];
    }
    // Between the clock of the run and that of the sound card, and toward the wanted wait.
    const off = this.#ahead - slack;
    const bend = Math.abs(off) < 0.004 ? 0 : Math.max(-BEND, Math.min(BEND, off / 5));
    this.#play(bent(samples, Math.round(samples.length * (1 + bend))), rate, whole);
    this.#next = first + samples.length;
  }

  #play(samples, rate, whole) {
    const context = this.#context;
    const buffer = new AudioBuffer({ length: samples.length, numberOfChannels: 1, sampleRate: rate });
    buffer.copyToChannel(samples, 0);
    const source = new AudioBufferSourceNode(context, { buffer });
    source.connect(this.#gate);
    source.onended = () => source.disconnect();
    // On the grid of samples: else the browser interpolates between them.
    const at = Math.round(this.#at * rate) / rate;
    const end = at + samples.length / rate;
    const { gain } = this.#gate;
    // The fade at the end of the block before holds only if nothing follows it.
    if (whole) gain.cancelScheduledValues(at - FADE_S - 0.5 / rate);
    else gain.setValueAtTime(0, at).linearRampToValueAtTime(1, at + FADE_S);
    gain.setValueAtTime(1, end - FADE_S).linearRampToValueAtTime(0, end);
    source.start(at);
    this.#at = end;
    this.scheduled += samples.length;
  }

  /** How much later than the earliest a view comes: the least of the last seconds is the way without a wait. */
  #delays(behind) {
    const late = this.#late ?? { least: behind, age: 0 };
    late.least = Math.min(late.least + 1e-5, behind);
    late.age += (behind - late.least - late.age) / 30;
    this.#late = late;
  }

  /** Writes how late the sound is. */
  show() {
    const context = this.#context;
    if (!context) return;
    if (context.state !== "running") return write(this.#text, "Waiting for the browser to allow sound.");
    const wait = Math.max(0, this.#at - context.currentTime) * 1000;
    const device = ((context.baseLatency || 0) + (context.outputLatency || 0)) * 1000;
    const way = (this.#late?.age ?? 0) * 1000 + (this.#link.there_and_back || 0) / 2;
    const gaps = this.underruns ? ` ${this.underruns} ${this.underruns === 1 ? "gap" : "gaps"} so far.` : "";
    write(this.#text, `${Math.round(wait + device + way)} ms late: waiting ${figure(wait)}, device ${figure(device)}, connection ${figure(way)}.${gaps}`);
  }
}

/** The same samples in another number, by lines between them. */
function bent(samples, count) {
  if (count === samples.length || count < 2 || samples.length < 2) return samples;
  const step = (samples.length - 1) / (count - 1);
  return Float32Array.from({ length: count }, (_, i) => {
    const at = Math.min(i * step, samples.length - 1);
    const k = Math.min(samples.length - 2, Math.floor(at));
    return samples[k] + (at - k) * (samples[k + 1] - samples[k]);
  });
}
