// The surface: strokes of a pointer on it are drawn, and played again.
import { canvas, colour, write } from "./draw.js";
import { BAR_PX, Pointer } from "./pointer.js";
import { lay } from "./quilt.js";

const INK_MS = 1200;
/// Ink fades in so many steps; a step is drawn as one line.
const FADES = 16;
/// Places this close and with about the same pressure are merged: a pen sends 250 a second.
const NEAR_MM = 1.2;
const LIKE = 0.03;
/// Period of the text with the place of the hand.
const TEXT_MS = 100;

export class Hand extends Pointer {
  #ink = canvas(document.getElementById("ink"));
  #grid = canvas(document.getElementById("grid"));
  #trail = [];
  #inked = true;
  /// Length of the bar in mm that the grid was drawn for.
  #ruled = 0;
  /// The picture on the surface and its width in mm.
  #picture = { image: null, mm: 0 };
  #told = 0;
  /// A stroke that is played again: its rows, the next one, and when it began.
  #again = null;

  /** Takes each sample of a touch: its place, and the number of the touch. */
  onSample() {}

  constructor(link) {
    super(link, document.getElementById("surface"));
    this.#fields();
  }

  offer(there) {
    super.offer(there);
    document.getElementById("invite").textContent = there
      ? "Stroke here with a pen, a finger or the mouse. With the mouse, hold the button; the wheel presses harder or softer."
      : "This graph does not listen to a pointer. Start it with --hand pointer to stroke it here.";
  }

  /** Lays a picture of so many millimetres on the surface, at true scale; null for none. */
  lay(image, mm) {
    this.#picture = { image, mm };
    this.#ruled = 0;
  }

  held(whose) {
    super.held(whose);
    document.getElementById("holder").textContent =
      { yours: "this page has the hand", theirs: "another page has the hand; touch to take it" }[whose] ?? "";
  }

  linked(there) {
    if (!there) this.endAgain();
    super.linked(there);
  }

  /** CSS pixels in a millimetre, and the place at the middle of the surface. */
  get view() {
    return { scale: BAR_PX / this.mm, ...this.middle };
  }

  /** Puts a place at the middle of the surface. */
  look(x, y) {
    this.middle = { x, y };
    this.#trail.length = 0;
    this.#inked = true;
    this.#ruled = 0;
  }

  /** Plays rows of a stroke again as this hand: time in s, x, y, pressure. False while the hand is in use. */
  again(rows, done) {
    if (this.pointer !== null || !this.there) return false;
    this.touch("again");
    this.#again = { rows, next: 0, from: performance.now(), done };
    return true;
  }

  /** Ends a stroke that is played again. */
  endAgain() {
    if (this.pointer === "again") this.lift(performance.now());
    const done = this.#again?.done;
    this.#again = null;
    done?.();
  }

  #fields() {
    const press = document.getElementById("press");
    const ruler = document.getElementById("ruler");
    document.getElementById("bar").style.width = `${BAR_PX}px`;
    ruler.value = this.mm.toFixed(1);
    ruler.addEventListener("change", () => {
      const mm = Number(ruler.value);
      if (mm >= 5 && mm <= 80) this.mm = mm;
      ruler.value = this.mm.toFixed(1);
      localStorage.setItem("asperity.bar_mm", String(this.mm));
    });
    press.addEventListener("input", () => this.setPress(Number(press.value)));
    this.setPress(this.press);
  }

  setPress(to) {
    super.setPress(to);
    document.getElementById("press").value = String(this.press);
    document.getElementById("press-now").textContent = this.press.toFixed(2);
  }

  down(event) {
    this.endAgain();
    super.down(event);
  }

  beat(now) {
    if (this.pointer !== "again") return super.beat(now);
    const { rows, from } = this.#again;
    const due = [];
    for (; this.#again.next < rows.length && from + rows[this.#again.next][0] * 1000 <= now; this.#again.next += 1) {
      const [t, x, y, pressure, ...tilt] = rows[this.#again.next];
      due.push({ at: from + t * 1000, x, y, pressure, tilt });
    }
    // As many as a message may hold.
    for (let i = 0; i < due.length; i += 100) this.send(due.slice(i, i + 100));
    if (this.#again.next === rows.length) this.endAgain();
  }

  sent(place, stroke) {
    this.#inked = true;
    this.#keep({ ...place, stroke });
    if (this.pointer !== "again") this.onSample(place, stroke);
  }

  /** Appends a place to the trail, or moves its end there. */
  #keep(place) {
    const [before, last] = [this.#trail.at(-2), this.#trail.at(-1)];
    const near = before && before.stroke === place.stroke && last.stroke === place.stroke && place.pressure > 0
      && Math.hypot(place.x - before.x, place.y - before.y) < NEAR_MM && Math.abs(place.pressure - before.pressure) < LIKE;
    if (near) this.#trail[this.#trail.length - 1] = place;
    else this.#trail.push(place);
  }

  free() {
    this.endAgain();
    super.free();
  }

  /** Draws the last second of the hand; more pressure is wider. */
  draw() {
    this.moved();
    this.#rule();
    const now = performance.now();
    const old = this.#trail.findIndex((place) => now - place.at < INK_MS);
    this.#trail.splice(0, old < 0 ? this.#trail.length : old);
    if (!this.#inked && !this.#trail.length && !this.#ink.resized()) return;
    this.#inked = this.#trail.length > 0;
    const { pen, width, height } = this.#ink.clear();
    const scale = BAR_PX / this.mm;
    const middle = this.middle;
    const X = (place) => width / 2 + (place.x - middle.x) * scale;
    const Y = (place) => height / 2 - (place.y - middle.y) * scale;
    // Round ends of transparent lines would show as dots where they meet.
    pen.lineCap = "butt";
    pen.lineJoin = "round";
    let like = "";
    // A pale edge, so that the line is seen on any picture.
    const line = () => {
      const [wide, fade] = [pen.lineWidth, pen.globalAlpha];
      Object.assign(pen, { lineWidth: wide + 4, globalAlpha: fade, strokeStyle: colour("--hand-edge") });
      pen.stroke();
      Object.assign(pen, { lineWidth: wide, globalAlpha: fade, strokeStyle: colour("--hand") });
      pen.stroke();
    };
    for (let i = 1; i < this.#trail.length; i += 1) {
      const [from, to] = [this.#trail[i - 1], this.#trail[i]];
      if (from.stroke !== to.stroke || from.pressure === 0) continue;
      const fade = Math.ceil(FADES * Math.max(0, 1 - (now - to.at) / INK_MS)) / FADES;
      const wide = 1 + Math.round(18 * to.pressure) / 2;
      const likeness = `${to.stroke} ${fade} ${wide}`;
      if (likeness !== like) {
        if (like) line();
        like = likeness;
        pen.globalAlpha = fade;
        pen.lineWidth = wide;
        pen.beginPath();
        pen.moveTo(X(from), Y(from));
      }
      pen.lineTo(X(to), Y(to));
    }
    if (like) line();
    pen.globalAlpha = 1;
    this.#tip(pen, X, Y);
    if (now - this.#told >= TEXT_MS || !this.#inked) {
      this.#told = now;
      this.#tell();
    }
  }

  #touches() {
    return this.last && (this.last.pressure > 0 || this.pointer !== null);
  }

  #tip(pen, X, Y) {
    if (!this.#touches()) return;
    const last = this.last;
    Object.assign(pen, { fillStyle: colour("--hand"), strokeStyle: colour("--hand-edge"), lineWidth: 2 });
    pen.beginPath();
    pen.arc(X(last), Y(last), 4 + 9 * last.pressure, 0, 7);
    pen.fill();
    pen.stroke();
  }

  /** Writes the place of the hand. */
  #tell() {
    const invite = document.getElementById("invite");
    const touched = this.pointer !== null && this.there;
    if (invite.hidden !== touched) invite.hidden = touched;
    const last = this.last;
    const mm = (x) => `${x.toFixed(1).replace("-", "−")} mm`;
    const tilted = last?.tilt?.some((x) => Math.abs(x) >= 0.5)
      ? `, tilt ${last.tilt.map((x) => x.toFixed(0).replace("-", "−")).join("°, ")}°` : "";
    const text = this.#touches()
      ? `x ${mm(last.x)}, y ${mm(last.y)}, pressure ${last.pressure.toFixed(2)}${tilted}`
      : last ? "lifted" : "";
    write(document.getElementById("where"), text);
  }

  /** Lines every 10 mm, so that a speed can be judged. */
  #rule() {
    if (!this.#grid.resized() && this.#ruled === this.mm) return;
    this.#ruled = this.mm;
    const { pen, width, height, scale } = this.#grid.clear();
    const { image, mm } = this.#picture;
    const pictured = image && mm > 0;
    if (pictured) lay(pen, width * scale, height * scale, image, mm, (BAR_PX * scale) / this.mm);
    pen.strokeStyle = colour(pictured ? "--over" : "--grid");
    pen.lineWidth = 1;
    pen.beginPath();
    const step = (10 * BAR_PX) / this.mm;
    const first = (from) => ((from % step) + step) % step;
    for (let x = first(width / 2 - (this.middle.x * step) / 10); x < width; x += step) {
      pen.moveTo(Math.round(x) + 0.5, 0);
      pen.lineTo(Math.round(x) + 0.5, height);
    }
    for (let y = first(height / 2 + (this.middle.y * step) / 10); y < height; y += step) {
      pen.moveTo(0, Math.round(y) + 0.5);
      pen.lineTo(width, Math.round(y) + 0.5);
    }
    pen.stroke();
  }
}
