// Helpers for drawing: canvases at screen resolution, colours of the style sheet, figures as text.

/** A canvas whose unit is a CSS pixel. A `solid` one is opaque. */
export function canvas(element, solid = false) {
  const pen = element.getContext("2d", { alpha: !solid });
  const box = { width: 0, height: 0, scale: 0, stale: true };
  const measure = () => {
    const { width, height } = element.getBoundingClientRect();
    const scale = Math.min(devicePixelRatio || 1, 2);
    if (width === box.width && height === box.height && scale === box.scale) return;
    Object.assign(box, { width, height, scale, stale: true });
  };
  new ResizeObserver(measure).observe(element);
  scheme.addEventListener("change", () => (box.stale = true));
  return {
    element,
    resized: () => box.stale,
    /** The pen, the size in CSS pixels, and the screen pixels in a CSS pixel. */
    kept: () => ({ pen, ...box }),
    clear() {
      if (!box.width) measure();
      const [w, h] = [Math.round(box.width * box.scale), Math.round(box.height * box.scale)];
      if (element.width !== w || element.height !== h) Object.assign(element, { width: w, height: h });
      box.stale = false;
      pen.setTransform(box.scale, 0, 0, box.scale, 0, 0);
      pen.font = "11px system-ui, sans-serif";
      if (solid) {
        pen.fillStyle = colour("--panel");
        pen.fillRect(0, 0, box.width, box.height);
      } else pen.clearRect(0, 0, box.width, box.height);
      return { pen, ...box };
    },
  };
}

const scheme = matchMedia("(prefers-color-scheme: dark)");
const known = new Map();
scheme.addEventListener("change", () => known.clear());

/** A colour of the style sheet, by the name of its variable. */
export function colour(name) {
  if (!known.has(name)) known.set(name, getComputedStyle(document.documentElement).getPropertyValue(name).trim());
  return known.get(name);
}

const SIGNALS = { speed: "--speed", force: "--force", acceleration: "--acceleration", current: "--current" };
const OTHERS = ["--other-1", "--other-2"];

/** The colour of a signal: the same wherever it is drawn. */
export function signal(name, place) {
  return colour(SIGNALS[name] ?? OTHERS[place % OTHERS.length]);
}

/** A number to three significant digits, of about constant length. */
export function figure(x) {
  if (x === null || x === undefined || !Number.isFinite(x)) return "–";
  const size = Math.abs(x);
  // Values below a millionth are the rest of a filter: shown as 0.
  if (size < 1e-6) return "0";
  if (size < 0.0005 || size >= 1e6) return x.toExponential(1).replace("-", "−").replace("e+", "e").replace("e-", "e−");
  const digits = size >= 100 ? 0 : size >= 10 ? 1 : size >= 1 ? 2 : 3;
  return x.toFixed(digits).replace("-", "−");
}

/** A whole number with thin spaces between its thousands. */
export function count(n) {
  return String(n ?? 0).replace(/\B(?=(\d{3})+$)/g, "\u2009");
}

/** An element with a class and a text. */
export function make(tag, name = "", text = "") {
  const element = document.createElement(tag);
  if (name) element.className = name;
  if (text !== "") element.textContent = text;
  return element;
}

/** Sets a text only if it differs, to save layout. */
export function write(element, text) {
  if (element.textContent === text) return;
  if (element.firstChild) element.firstChild.nodeValue = text;
  else element.textContent = text;
}

/** The least of 1, 1.5, 2, 3, 4, 5, 6, 8, 10, ... that is at least `x`. */
export function round(x) {
  if (!(x > 0)) return 1;
  const ten = 10 ** Math.floor(Math.log10(x));
  return [1, 1.5, 2, 3, 4, 5, 6, 8, 10].map((k) => k * ten).find((k) => k >= x * 0.999) ?? 10 * ten;
}
