// The spectrum of acceleration and current: amplitude over a logarithmic frequency axis.
import { canvas, colour, figure, make, signal, write } from "./draw.js";

const [LOW_HZ, HIGH_HZ] = [10, 1000];
const SHOWN = ["acceleration", "current", "voltage"];
const RANGE_DB = 70;
/// Long enough to separate 10 Hz from 12 Hz.
const WINDOW_S = 0.4;
const EVERY_MS = 80;
/// Signals faster than twice this are decimated first: nothing above HIGH_HZ is shown.
const ENOUGH_HZ = 5000;

/** In-place FFT of a power of two: Cooley and Tukey 1965, decimation in time. */
export function fft(re, im) {
  const n = re.length;
  for (let i = 1, j = 0; i < n; i += 1) {
    let bit = n >> 1;
    for (; j & bit; bit >>= 1) j ^= bit;
    j ^= bit;
    if (i < j) {
      [re[i], re[j]] = [re[j], re[i]];
      [im[i], im[j]] = [im[j], im[i]];
    }
  }
  const { cos, sin } = turns(n);
  for (let half = 1; half < n; half *= 2) {
    const stride = n / (2 * half);
    for (let start = 0; start < n; start += 2 * half) {
      for (let k = 0; k < half; k += 1) {
        const [a, b] = [start + k, start + k + half];
        const [c, s] = [cos[k * stride], sin[k * stride]];
        const x = re[b] * c + im[b] * s;
        const y = im[b] * c - re[b] * s;
        re[b] = re[a] - x;
        im[b] = im[a] - y;
        re[a] += x;
        im[a] += y;
      }
    }
  }
}

const tables = new Map();

function turns(n) {
  if (!tables.has(n)) {
    const angle = (_, k) => (2 * Math.PI * k) / n;
    tables.set(n, {
      cos: Float64Array.from({ length: n / 2 }, (_, k) => Math.cos(angle(_, k))),
      sin: Float64Array.from({ length: n / 2 }, (_, k) => Math.sin(angle(_, k))),
    });
  }
  return tables.get(n);
}

/** Amplitudes of the bins of `samples` under a Hann window. A sine of amplitude 1 on a bin reads 1. */
export function amplitudes(samples) {
  const n = samples.length;
  const re = new Float64Array(n);
  const im = new Float64Array(n);
  for (let i = 0; i < n; i += 1) re[i] = samples[i] * (0.5 - 0.5 * Math.cos((2 * Math.PI * i) / n));
  fft(re, im);
  return Float64Array.from({ length: n / 2 }, (_, k) => (4 * Math.hypot(re[k], im[k])) / n);
}

/**
 * Decimates by `by` after a low-pass: `n` samples, the newest last. The filter is a windowed sinc of
 * 12 `by` + 1 taps (Blackman) that halves at the new Nyquist frequency. Aliases onto the lowest quarter of the
 * new rate stay below 1e-3.
 */
export function slowed(samples, by, n) {
  const taps = lowPass(by);
  const into = new Float64Array(n);
  const last = samples.length - taps.length;
  for (let i = 0; i < n; i += 1) {
    const from = last - (n - 1 - i) * by;
    let sum = 0;
    for (let k = 0; k < taps.length; k += 1) sum += taps[k] * samples[from + k];
    into[i] = sum;
  }
  return into;
}

const filters = new Map();

function lowPass(by) {
  if (!filters.has(by)) {
    const n = 12 * by + 1;
    const taps = Float64Array.from({ length: n }, (_, k) => {
      const [x, turn] = [(k - (n - 1) / 2) / by, (2 * Math.PI * k) / (n - 1)];
      const sinc = x === 0 ? 1 : Math.sin(Math.PI * x) / (Math.PI * x);
      return sinc * (0.42 - 0.5 * Math.cos(turn) + 0.08 * Math.cos(2 * turn));
    });
    const sum = taps.reduce((all, x) => all + x, 0);
    filters.set(by, by > 1 ? taps.map((x) => x / sum) : new Float64Array([1]));
  }
  return filters.get(by);
}

export class Spectrum {
  #canvas;
  #key;
  #scopes;
  #curves = new Map();
  #drawn = 0;
  #tops = new Map();
  #labels = [];

  constructor(element, key, scopes) {
    this.#canvas = canvas(element, true);
    this.#key = key;
    this.#scopes = scopes;
  }

  draw(now) {
    if (now - this.#drawn < EVERY_MS) return;
    this.#drawn = now;
    const shown = this.#scopes.all.filter((scope) => SHOWN.includes(scope.name)).slice(0, 2);
    for (const scope of shown) this.#analyse(scope);
    const { pen, width, height } = this.#canvas.clear();
    const box = { left: 40, right: width - 40, top: 8, bottom: height - 20 };
    this.#frequencies(pen, box);
    shown.forEach((scope, i) => this.#curve(pen, box, scope, i === 0 ? "left" : "right"));
    this.#label(shown);
  }

  #analyse(scope) {
    const { rate, whole } = scope.samples;
    const by = 2 ** Math.max(0, Math.floor(Math.log2(rate / ENOUGH_HZ)));
    const n = 2 ** Math.ceil(Math.log2((rate / by) * WINDOW_S));
    const samples = new Float32Array((n - 1) * by + lowPass(by).length);
    if (whole < samples.length) return this.#curves.delete(scope.name);
    scope.samples.newest(samples.length, samples);
    const bins = amplitudes(slowed(samples, by, n));
    const hz = rate / by / n;
    const last = Math.min(bins.length - 1, Math.ceil(HIGH_HZ / hz));
    let peak = 1;
    for (let k = Math.ceil(LOW_HZ / hz); k <= last; k += 1) if (bins[k] > bins[peak]) peak = k;
    this.#curves.set(scope.name, { bins, hz, last, peak });
  }

  /** The top of the scale moves in steps of 10 dB: up at once, down when 20 dB are free. */
  #top(name, peak_db) {
    let top = this.#tops.get(name) ?? 0;
    const need = Math.max(-40, Math.ceil((peak_db + 3) / 10) * 10);
    // Silence does not change the scale.
    const silent = peak_db < -120;
    if (need > top || (need < top - 10 && !silent)) top = need;
    this.#tops.set(name, top);
    return top;
  }

  #frequencies(pen, { left, right, top, bottom }) {
    pen.strokeStyle = colour("--grid");
    pen.fillStyle = colour("--quiet");
    pen.lineWidth = 1;
    pen.textBaseline = "top";
    pen.beginPath();
    for (const hz of [10, 20, 30, 40, 50, 60, 70, 80, 90, 100, 200, 300, 400, 500, 600, 700, 800, 900, 1000]) {
      const x = Math.round(left + (Math.log10(hz / LOW_HZ) / 2) * (right - left)) + 0.5;
      pen.moveTo(x, top);
      pen.lineTo(x, bottom);
      pen.textAlign = "center";
      const roomy = right - left > 220 || [10, 100, 1000].includes(hz);
      if (roomy && [10, 20, 50, 100, 200, 500, 1000].includes(hz)) pen.fillText(String(hz), x, bottom + 5);
    }
    pen.textAlign = "left";
    pen.fillText("Hz", right + 16, bottom + 5);
    pen.stroke();
  }

  #curve(pen, box, scope, side) {
    const curve = this.#curves.get(scope.name);
    if (!curve) return;
    const { bins, hz, last, peak } = curve;
    const db = (k) => 20 * Math.log10(bins[k] + 1e-12);
    const top = this.#top(scope.name, db(peak));
    const y = (level) => box.top + ((top - level) / RANGE_DB) * (box.bottom - box.top);
    pen.fillStyle = signal(scope.name, scope.place);
    pen.textBaseline = "middle";
    pen.textAlign = side === "left" ? "right" : "left";
    for (let level = top; level >= top - RANGE_DB; level -= 20) {
      const x = side === "left" ? box.left - 5 : box.right + 5;
      pen.fillText(String(level).replace("-", "−"), x, Math.max(y(level), 6));
    }
    pen.save();
    pen.beginPath();
    pen.rect(box.left, box.top, box.right - box.left, box.bottom - box.top);
    pen.clip();
    pen.strokeStyle = pen.fillStyle;
    pen.lineWidth = 1.4;
    pen.lineJoin = "round";
    pen.beginPath();
    // Of bins that share a pixel the largest is drawn, so that no line is lost.
    let [column, most] = [-1, -Infinity];
    for (let k = Math.max(1, Math.floor(LOW_HZ / hz)); k <= last; k += 1) {
      const x = box.left + (Math.log10((k * hz) / LOW_HZ) / 2) * (box.right - box.left);
      most = Math.max(most, db(k));
      if (Math.floor(x) === column) continue;
      column = Math.floor(x);
      pen.lineTo(x, y(Math.max(most, top - RANGE_DB - 5)));
      most = -Infinity;
    }
    pen.stroke();
    pen.restore();
  }

  #label(shown) {
    if (shown.length !== this.#labels.length) {
      this.#labels = shown.map(() => ({ dot: make("i", "dot"), text: make("span"), colour: "" }));
      this.#key.replaceChildren(...this.#labels.map(({ dot, text }) => {
        const one = make("span");
        one.append(dot, text);
        return one;
      }));
    }
    shown.forEach((scope, i) => {
      const label = this.#labels[i];
      const now = signal(scope.name, scope.place);
      if (label.colour !== now) label.dot.style.background = label.colour = now;
      const curve = this.#curves.get(scope.name);
      const peak = curve && curve.bins[curve.peak] > 1e-9
        ? `, most at ${Math.round(curve.peak * curve.hz)} Hz: ${figure(curve.bins[curve.peak])} ${scope.unit}`
        : "";
      write(label.text, `${scope.name}, dB re 1 ${scope.unit}${peak}`);
    });
  }
}
