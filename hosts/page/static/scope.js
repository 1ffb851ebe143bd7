// Scopes: what the signals did in the last seconds, scrolling. A strip keeps the least and the greatest sample of every
// column, so that drawing costs the same at 500 Hz and at 48 kHz.
import { canvas, colour, figure, make, round, signal, write } from "./draw.js";

const COLUMNS = 480;
const SPANS_S = [0.5, 2, 10];
/// A scale grows at once, and shrinks when the signal stayed under this part of it for so many columns.
const SMALL = 0.35;
const PATIENT_S = 1.5;
/// Samples kept for the spectrum.
const KEPT = 65536;

/** The last samples of a signal. */
class Samples {
  constructor(rate) {
    this.rate = rate;
    this.ring = new Float32Array(KEPT);
    this.next = 0;
    /// Samples since the last hole.
    this.whole = 0;
  }

  take(first, samples) {
    if (first !== this.next) this.whole = 0;
    this.next = first;
    for (const x of samples) {
      this.ring[this.next % KEPT] = x;
      this.next += 1;
    }
    this.whole = Math.min(KEPT, this.whole + samples.length);
  }

  /** The newest `n`, oldest first. */
  newest(n, into) {
    for (let i = 0; i < n; i += 1) into[i] = this.ring[(this.next - n + i) % KEPT];
  }
}

/** Least and greatest of every column of the last `span` seconds. */
class Strip {
  constructor(rate, span) {
    this.per = (rate * span) / COLUMNS;
    this.least = new Float32Array(COLUMNS).fill(NaN);
    this.most = new Float32Array(COLUMNS).fill(NaN);
    this.column = -1;
  }

  take(first, samples) {
    for (let i = 0; i < samples.length; i += 1) {
      const column = Math.floor((first + i) / this.per);
      if (column !== this.column) this.#begin(column);
      const [at, x] = [column % COLUMNS, samples[i]];
      if (!(this.least[at] <= x)) this.least[at] = x;
      if (!(this.most[at] >= x)) this.most[at] = x;
    }
  }

  #begin(column) {
    // Columns that no sample fell into are empty: a signal slower than the columns is drawn as steps, a hole as a hole.
    const from = Math.max(this.column + 1, column - COLUMNS + 1);
    const step = column - this.column <= Math.ceil(1 / this.per) + 1 && this.column >= 0;
    const [least, most] = [this.least[this.column % COLUMNS], this.most[this.column % COLUMNS]];
    for (let c = from; c <= column; c += 1) {
      this.least[c % COLUMNS] = step && c < column ? least : NaN;
      this.most[c % COLUMNS] = step && c < column ? most : NaN;
    }
    this.column = column;
  }
}

class Scope {
  constructor(layout, place, span) {
    this.name = layout.name;
    this.place = place;
    this.unit = layout.unit;
    this.samples = new Samples(layout.rate_hz);
    this.row = make("figure", "scope");
    const caption = make("figcaption");
    this.now = make("output", "figure");
    this.dot = make("i", "dot");
    caption.append(this.dot, make("b", "", layout.name), this.now);
    const element = make("canvas");
    element.setAttribute("role", "img");
    element.setAttribute("aria-label", `${layout.name} over time`);
    this.row.append(caption, element);
    this.canvas = canvas(element);
    this.top = 0;
    this.quiet = 0;
    this.last = 0;
    this.written = 0;
    this.span(span);
  }

  span(span) {
    this.seconds = span;
    this.strip = new Strip(this.samples.rate, span);
    const n = Math.min(this.samples.whole, Math.floor(this.samples.rate * span), KEPT);
    const old = new Float32Array(n);
    this.samples.newest(n, old);
    this.strip.take(this.samples.next - n, old);
  }

  take(first, samples) {
    this.samples.take(first, samples);
    this.strip.take(first, samples);
    if (samples.length) this.last = samples[samples.length - 1];
  }

  #scale(greatest, signed) {
    const need = round(greatest * 1.05);
    const now = performance.now();
    if (!this.top || need > this.top) {
      this.top = need;
      this.quiet = now;
    } else if (greatest > this.top * SMALL) this.quiet = now;
    else if (now - this.quiet > PATIENT_S * 1000) {
      this.top = Math.max(need, 1e-9);
      this.quiet = now;
    }
    return [signed ? -this.top : 0, this.top];
  }

  draw() {
    const { least, most, column } = this.strip;
    const { pen, width, height } = this.canvas.clear();
    let [low, high] = [0, 0];
    for (let i = 0; i < COLUMNS; i += 1) {
      if (least[i] < low) low = least[i];
      if (most[i] > high) high = most[i];
    }
    this.signed = low < -0.05 * high || (this.signed && performance.now() - this.quiet < 5000);
    const [bottom, top] = this.#scale(Math.max(high, -low), this.signed);
    const left = 46;
    const y = (x) => 5 + ((top - Math.max(x, bottom)) / (top - bottom)) * (height - 10);
    this.#axis(pen, left, width, y, bottom, top);
    pen.strokeStyle = signal(this.name, this.place);
    pen.lineWidth = 1.3;
    pen.lineJoin = "round";
    pen.beginPath();
    let drawing = false;
    for (let i = 0; i < COLUMNS; i += 1) {
      const at = (column + 1 + i + COLUMNS) % COLUMNS;
      if (Number.isNaN(least[at])) {
        drawing = false;
        continue;
      }
      const x = left + ((i + 0.5) / COLUMNS) * (width - left);
      if (drawing) pen.lineTo(x, y(most[at]));
      else pen.moveTo(x, y(most[at]));
      if (least[at] !== most[at]) pen.lineTo(x, y(least[at]));
      drawing = true;
    }
    pen.stroke();
    this.dot.style.background = signal(this.name, this.place);
    if (performance.now() - this.written > 100) {
      this.written = performance.now();
      write(this.now, this.#figure(column));
    }
  }

  /** The value of a slow signal; of a fast one the root mean square of the last tenth of a second. */
  #figure(column) {
    const { rate, whole } = this.samples;
    if (column < 0) return "–";
    if (!this.signed) return `${figure(this.last)} ${this.unit}`;
    const n = Math.min(whole, Math.floor(rate / 10));
    const last = new Float32Array(n);
    this.samples.newest(n, last);
    const rms = Math.sqrt(last.reduce((sum, x) => sum + x * x, 0) / Math.max(1, n));
    return `${figure(rms)} ${this.unit} rms`;
  }

  #axis(pen, left, width, y, bottom, top) {
    pen.strokeStyle = colour("--grid");
    pen.fillStyle = colour("--quiet");
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    pen.lineWidth = 1;
    const marks = bottom < 0 ? [top, 0, bottom] : [top, top / 2, 0];
    pen.beginPath();
    for (const mark of marks) {
      const line = Math.round(y(mark)) + 0.5;
      pen.moveTo(left, line);
      pen.lineTo(width, line);
      pen.fillText(figure(mark), left - 6, Math.min(Math.max(y(mark), 7), y(bottom) - 1));
    }
    pen.stroke();
  }
}

export class Scopes {
  all = [];
  #box;
  #span = 2;

  constructor(box, choice) {
    this.#box = box;
    for (const seconds of SPANS_S) {
      const button = make("button", "", `${seconds} s`);
      button.type = "button";
      button.setAttribute("aria-pressed", String(seconds === this.#span));
      button.addEventListener("click", () => {
        this.#span = seconds;
        for (const one of choice.children) one.setAttribute("aria-pressed", String(one === button));
        for (const scope of this.all) scope.span(seconds);
      });
      choice.append(button);
    }
  }

  layout({ scopes }) {
    this.all = scopes.map((scope, place) => new Scope(scope, place, this.#span));
    this.#box.replaceChildren(...this.all.map((scope) => scope.row));
  }

  /** Another run counts its samples anew. */
  restart() {
    for (const scope of this.all) {
      scope.samples.whole = 0;
      scope.samples.next = 0;
      scope.span(this.#span);
    }
  }

  take(places, samples) {
    let from = 0;
    places.forEach(([first, count], i) => {
      this.all[i]?.take(first, samples.subarray(from, from + count));
      from += count;
    });
  }

  draw() {
    for (const scope of this.all) scope.draw();
  }
}
