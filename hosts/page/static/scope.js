// Scopes: the last seconds of the signals, scrolling. A strip keeps the least and the greatest sample of every
// column of the screen, so that drawing costs the same at 500 Hz and at 48 kHz. The drawn strip is shifted, and
// only new columns are drawn.
import { canvas, colour, figure, make, round, signal, write } from "./draw.js";

/// Room for the scale, in CSS pixels.
const LEFT = 46;
/// Width of a line, in CSS pixels.
const LINE = 1.3;
const SPANS_S = [0.5, 2, 10];
/// A scale grows at once. It shrinks when all that is drawn has fitted a smaller one for so long.
const PATIENT_MS = 500;
/// Samples kept for the spectrum.
const KEPT = 131072;

/** The last samples of a signal. */
class Samples {
  constructor(rate) {
    this.rate = rate;
    this.ring = new Float32Array(KEPT);
    this.next = 0;
    /// Samples since the last gap.
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
  constructor(rate, span, columns) {
    this.columns = columns;
    this.per = (rate * span) / columns;
    this.least = new Float32Array(columns).fill(NaN);
    this.most = new Float32Array(columns).fill(NaN);
    this.column = -1;
  }

  take(first, samples) {
    for (let i = 0; i < samples.length; i += 1) {
      const column = Math.floor((first + i) / this.per);
      if (column !== this.column) this.#begin(column);
      const [at, x] = [column % this.columns, samples[i]];
      if (!(this.least[at] <= x)) this.least[at] = x;
      if (!(this.most[at] >= x)) this.most[at] = x;
    }
  }

  #begin(column) {
    const { columns } = this;
    // A signal slower than the columns is drawn as steps. Columns of a gap are empty.
    const from = Math.max(this.column + 1, column - columns + 1);
    const step = column - this.column <= Math.ceil(1 / this.per) + 1 && this.column >= 0;
    const [least, most] = [this.least[this.column % columns], this.most[this.column % columns]];
    for (let c = from; c <= column; c += 1) {
      this.least[c % columns] = step && c < column ? least : NaN;
      this.most[c % columns] = step && c < column ? most : NaN;
    }
    this.column = column;
  }
}

/** The upper end of an axis: a round number close above the greatest value that is drawn. */
export class Scale {
  top = 0;
  #since = 0;

  fit(greatest, now) {
    // Silence keeps the scale.
    const need = greatest > 0 ? round(greatest * 1.05) : this.top || 1;
    if (need >= this.top || now - this.#since > PATIENT_MS) {
      this.top = need;
      this.#since = now;
    }
    return this.top;
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
    this.canvas = canvas(element, true);
    this.scale = new Scale();
    /// When the signal was last below 0.
    this.below = -Infinity;
    this.last = 0;
    this.written = 0;
    /// The newest column that is drawn, and the scale it was drawn in.
    this.drawn = { column: -1, bottom: 0, top: 0 };
    this.strip = new Strip(this.samples.rate, span, 1);
    this.span(span);
  }

  span(span, columns = this.strip.columns) {
    this.seconds = span;
    this.strip = new Strip(this.samples.rate, span, columns);
    this.drawn.column = -1;
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

  draw() {
    const now = performance.now();
    if (this.canvas.resized()) this.#begin();
    const { least, most, column, columns } = this.strip;
    let [low, high] = [0, 0];
    for (let i = 0; i < columns; i += 1) {
      if (least[i] < low) low = least[i];
      if (most[i] > high) high = most[i];
    }
    if (low < -0.05 * high) this.below = now;
    this.signed = now - this.below < 5000;
    const top = this.scale.fit(Math.max(high, -low), now);
    const bottom = this.signed ? -top : 0;
    const { drawn } = this;
    const { pen, width, height, scale } = this.canvas.kept();
    const all = drawn.column < 0 || column - drawn.column >= columns || drawn.bottom !== bottom || drawn.top !== top;
    // From here on the unit is a screen pixel.
    const plot = { pen, scale, left: Math.round(LEFT * scale), width: Math.round(width * scale), high: Math.round(height * scale) };
    plot.y = (x) => (5 + ((top - Math.max(x, bottom)) / (top - bottom)) * (height - 10)) * scale;
    plot.marks = bottom < 0 ? [top, 0, bottom] : [top, top / 2, 0];
    const behind = all ? columns - 1 : column - drawn.column;
    if (all) this.#axis(plot, this.canvas.clear());
    pen.setTransform(1, 0, 0, 1, 0, 0);
    if (!all && behind > 0) {
      const { element } = this.canvas;
      const [from, wide] = [plot.left + behind, plot.width - plot.left - behind];
      pen.drawImage(element, from, 0, wide, plot.high, plot.left, 0, wide, plot.high);
    }
    this.#columns(plot, Math.max(0, column - behind), column);
    Object.assign(drawn, { column, bottom, top });
    if (now - this.written > 100) {
      this.written = now;
      write(this.now, this.#figure(column));
    }
  }

  /** New size or colours: makes a strip with one column for each pixel and draws all of it. */
  #begin() {
    const { width, scale } = this.canvas.clear();
    const columns = Math.max(1, Math.round(width * scale) - Math.round(LEFT * scale));
    if (columns !== this.strip.columns) this.span(this.seconds, columns);
    this.drawn.column = -1;
    this.dot.style.background = signal(this.name, this.place);
  }

  /** Draws columns over the lines of the scale. Each reaches to the one before, so that they form a line. */
  #columns({ pen, scale, left, width, high, y, marks }, from, to) {
    const { least, most, column, columns } = this.strip;
    const [x, wide] = [width - 1 - (column - from), to - from + 1];
    pen.fillStyle = colour("--panel");
    pen.fillRect(Math.max(x, left), 0, wide, high);
    pen.fillStyle = colour("--grid");
    for (const mark of marks) pen.fillRect(Math.max(x, left), Math.round(y(mark)), wide, Math.round(scale));
    pen.fillStyle = signal(this.name, this.place);
    for (let c = from; c <= to; c += 1) {
      const at = c % columns;
      let [low, top] = [least[at], most[at]];
      if (Number.isNaN(low)) continue;
      const before = c > 0 && c > column - columns + 1 ? (c - 1) % columns : at;
      if (low > most[before]) low = most[before];
      if (top < least[before]) top = least[before];
      const begin = y(top) - (LINE * scale) / 2;
      pen.fillRect(width - 1 - (column - c), begin, 1, y(low) + (LINE * scale) / 2 - begin);
    }
  }

  /** The value of a slow signal, or the root mean square of 0.1 s of a fast one. */
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

  /** The figures of the scale. Its lines are drawn with the columns. */
  #axis({ marks, y, scale }, { pen, height }) {
    pen.fillStyle = colour("--quiet");
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    for (const mark of marks) pen.fillText(figure(mark), LEFT - 6, Math.min(Math.max(y(mark) / scale, 7), height - 6));
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

  /** Another run restarts its count of samples. */
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
