// The surface: strokes of a pointer are sent to the run at once, and drawn.
import { canvas, colour, write } from "./draw.js";
import { lay } from "./quilt.js";

const INCH_MM = 25.4;
const BAR_PX = 96;
/// A resting or lifted hand repeats its sample this often; a source stalls after 50 ms.
const BEAT_MS = 15;
/// Moves arrive late, by up to a frame. A repeated sample must not overtake them.
const BEHIND_MS = 8;
const INK_MS = 1200;
/// Ink fades in so many steps; a step is drawn as one line.
const FADES = 16;
/// Places this close and with about the same pressure are merged: a pen sends 250 a second.
const NEAR_MM = 1.2;
const LIKE = 0.03;
/// Period of the text with the place of the hand.
const TEXT_MS = 100;

export class Hand {
  #link;
  #surface = document.getElementById("surface");
  #ink = canvas(document.getElementById("ink"));
  #grid = canvas(document.getElementById("grid"));
  #mm = Number(localStorage.getItem("asperity.bar_mm")) || INCH_MM;
  #press = Number(localStorage.getItem("asperity.pressure")) || 0.4;
  #there = false;
  #mine = false;
  #pointer = null;
  #stroke = Math.floor(Math.random() * 1e6);
  #last = null;
  #said = 0;
  #trail = [];
  #inked = true;
  /// Length of the bar in mm that the grid was drawn for.
  #ruled = 0;
  /// The picture on the surface and its width in mm.
  #picture = { image: null, mm: 0 };
  #told = 0;
  #box = null;
  #mouse = false;
  #glide = null;

  constructor(link) {
    this.#link = link;
    const surface = this.#surface;
    // Raw updates come at once, moves wait for the next frame. A browser has one or both: only one is used.
    const moves = "onpointerrawupdate" in window ? "pointerrawupdate" : "pointermove";
    surface.addEventListener("pointerdown", (event) => this.#down(event));
    surface.addEventListener(moves, (event) => this.#move(event));
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) {
      surface.addEventListener(name, (event) => this.#up(event));
    }
    surface.addEventListener("wheel", (event) => this.#wheel(event), { passive: false });
    surface.addEventListener("contextmenu", (event) => event.preventDefault());
    surface.addEventListener("keydown", (event) => this.#key(event));
    surface.addEventListener("keyup", (event) => this.#keyUp(event));
    surface.addEventListener("blur", () => this.#pointer === "keys" && this.#lift(performance.now()));
    document.addEventListener("visibilitychange", () => document.hidden && this.#free());
    addEventListener("pagehide", () => this.#free());
    setInterval(() => this.#beat(), 5);
    this.#fields();
  }

  /** Whether the graph listens to a pointer. */
  offer(there) {
    this.#there = there;
    this.#surface.classList.toggle("deaf", !there);
    document.getElementById("invite").textContent = there
      ? "Stroke here with a pen, a finger or the mouse. With the mouse, hold the button; the wheel presses harder or softer."
      : "This graph does not listen to a pointer. Start it with --hand pointer to stroke it here.";
  }

  /** Lays a picture of so many millimetres on the surface, at true scale; null for none. */
  lay(image, mm) {
    this.#picture = { image, mm };
    this.#ruled = 0;
  }

  /** Whose hand it is: yours, theirs or free. */
  held(whose) {
    this.#mine = whose === "yours";
    document.getElementById("holder").textContent =
      { yours: "this page has the hand", theirs: "another page has the hand; touch to take it" }[whose] ?? "";
  }

  linked(there) {
    if (!there) {
      this.held("free");
      this.#pointer = null;
    }
  }

  #fields() {
    const press = document.getElementById("press");
    const ruler = document.getElementById("ruler");
    document.getElementById("bar").style.width = `${BAR_PX}px`;
    ruler.value = this.#mm.toFixed(1);
    ruler.addEventListener("change", () => {
      const mm = Number(ruler.value);
      if (mm >= 5 && mm <= 80) this.#mm = mm;
      ruler.value = this.#mm.toFixed(1);
      localStorage.setItem("asperity.bar_mm", String(this.#mm));
    });
    press.addEventListener("input", () => this.#setPress(Number(press.value)));
    this.#setPress(this.#press);
  }

  #setPress(to) {
    this.#press = Math.min(1, Math.max(0.02, to));
    document.getElementById("press").value = String(this.#press);
    document.getElementById("press-now").textContent = this.#press.toFixed(2);
    localStorage.setItem("asperity.pressure", String(this.#press));
  }

  #wheel(event) {
    event.preventDefault();
    this.#setPress(this.#press - Math.sign(event.deltaY) * 0.02);
  }

  /** Pens have a pressure. A mouse has none, nor has a finger on a screen that reports only 0, 0.5 or 1. */
  #pressure(event) {
    const felt = event.pointerType === "pen" || ![0, 0.5, 1].includes(event.pressure);
    return event.pointerType !== "mouse" && felt ? Math.min(1, event.pressure) : this.#press;
  }

  #place(event) {
    // The place of the surface is read once a frame; a pen moves several times in one.
    this.#box ??= this.#surface.getBoundingClientRect();
    const box = this.#box;
    const mm = this.#mm / BAR_PX;
    return {
      at: event.timeStamp,
      x: (event.clientX - box.left - box.width / 2) * mm,
      y: (box.top + box.height / 2 - event.clientY) * mm,
      pressure: this.#pressure(event),
    };
  }

  #down(event) {
    if (this.#pointer !== null || !this.#there || event.button !== 0) return;
    this.#surface.setPointerCapture(event.pointerId);
    this.#box = null;
    this.#pointer = event.pointerId;
    this.#mouse = event.pointerType === "mouse";
    this.#stroke += 1;
    this.#send([this.#place(event)]);
  }

  #move(event) {
    if (event.pointerId !== this.#pointer) return;
    const all = event.getCoalescedEvents?.() ?? [];
    this.#send((all.length ? all : [event]).map((one) => this.#place(one)));
  }

  #up(event) {
    if (event.pointerId !== this.#pointer) return;
    this.#pointer = null;
    const place = event.type === "pointerup" ? this.#place(event) : { ...this.#last, at: event.timeStamp };
    this.#send([{ ...place, pressure: 0 }]);
  }

  #lift(at) {
    this.#pointer = null;
    if (this.#last) this.#send([{ ...this.#last, at, pressure: 0 }]);
  }

  /** Arrow keys stroke too: while one is held, the hand moves at 60 mm/s. */
  #key(event) {
    const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (!way || !this.#there) return;
    event.preventDefault();
    if (event.repeat || (this.#pointer !== null && this.#pointer !== "keys")) return;
    if (this.#pointer === null) this.#stroke += 1;
    this.#pointer = "keys";
    this.#glide = { way, key: event.key, at: event.timeStamp, from: this.#last ?? { x: 0, y: 0 } };
    this.#send([{ at: event.timeStamp, x: this.#glide.from.x, y: this.#glide.from.y, pressure: this.#press }]);
  }

  #keyUp(event) {
    if (this.#pointer === "keys" && event.key === this.#glide.key) this.#lift(event.timeStamp);
  }

  #beat() {
    const now = performance.now();
    if (this.#pointer === "keys") {
      const { way, at, from } = this.#glide;
      const mm = ((now - at) / 1000) * 60;
      const box = this.#surface.getBoundingClientRect();
      const scale = this.#mm / BAR_PX;
      const fold = (x, size) => {
        const half = (size / 2) * scale;
        const turn = (((x + half) % (4 * half)) + 4 * half) % (4 * half);
        return (turn < 2 * half ? turn : 4 * half - turn) - half;
      };
      const [x, y] = [fold(from.x + way[0] * mm, box.width), fold(from.y + way[1] * mm, box.height)];
      this.#send([{ at: now, x, y, pressure: this.#press }]);
    } else if (this.#mine && this.#last && now - this.#said >= BEAT_MS && !document.hidden) {
      // The wheel changes the pressure of a resting mouse.
      const pressure = this.#mouse && this.#pointer !== null ? this.#press : this.#last.pressure;
      this.#send([{ ...this.#last, pressure, at: Math.max(now - BEHIND_MS, this.#last.at) }]);
    }
  }

  #send(places) {
    const numbers = new Float64Array(2 + 5 * places.length);
    const now = performance.now();
    numbers.set([1, now]);
    places.forEach((place, i) => {
      const at = Math.min(now, Math.max(place.at, this.#last ? this.#last.at + 0.01 : 0));
      this.#last = { ...place, at };
      numbers.set([at, place.x, place.y, place.pressure, this.#stroke], 2 + 5 * i);
      this.#keep({ ...this.#last, stroke: this.#stroke });
    });
    this.#said = now;
    this.#inked = true;
    this.#link.tell(numbers);
  }

  /** Appends a place to the trail, or moves its end there. */
  #keep(place) {
    const [before, last] = [this.#trail.at(-2), this.#trail.at(-1)];
    const near = before && before.stroke === place.stroke && last.stroke === place.stroke && place.pressure > 0
      && Math.hypot(place.x - before.x, place.y - before.y) < NEAR_MM && Math.abs(place.pressure - before.pressure) < LIKE;
    if (near) this.#trail[this.#trail.length - 1] = place;
    else this.#trail.push(place);
  }

  #free() {
    this.#pointer = null;
    this.#mine = false;
    this.#link.tell(new Float64Array([2]));
  }

  /** Draws the last second of the hand; more pressure is wider. */
  draw() {
    this.#box = null;
    this.#rule();
    const now = performance.now();
    const old = this.#trail.findIndex((place) => now - place.at < INK_MS);
    this.#trail.splice(0, old < 0 ? this.#trail.length : old);
    if (!this.#inked && !this.#trail.length && !this.#ink.resized()) return;
    this.#inked = this.#trail.length > 0;
    const { pen, width, height } = this.#ink.clear();
    const scale = BAR_PX / this.#mm;
    const [X, Y] = [(place) => width / 2 + place.x * scale, (place) => height / 2 - place.y * scale];
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
    return this.#last && (this.#last.pressure > 0 || this.#pointer !== null);
  }

  #tip(pen, X, Y) {
    if (!this.#touches()) return;
    const last = this.#last;
    Object.assign(pen, { fillStyle: colour("--hand"), strokeStyle: colour("--hand-edge"), lineWidth: 2 });
    pen.beginPath();
    pen.arc(X(last), Y(last), 4 + 9 * last.pressure, 0, 7);
    pen.fill();
    pen.stroke();
  }

  /** Writes the place of the hand. */
  #tell() {
    const invite = document.getElementById("invite");
    const touched = this.#pointer !== null && this.#there;
    if (invite.hidden !== touched) invite.hidden = touched;
    const last = this.#last;
    const mm = (x) => `${x.toFixed(1).replace("-", "−")} mm`;
    const text = this.#touches()
      ? `x ${mm(last.x)}, y ${mm(last.y)}, pressure ${last.pressure.toFixed(2)}`
      : last ? "lifted" : "";
    write(document.getElementById("where"), text);
  }

  /** Lines every 10 mm, so that a speed can be judged. */
  #rule() {
    if (!this.#grid.resized() && this.#ruled === this.#mm) return;
    this.#ruled = this.#mm;
    const { pen, width, height, scale } = this.#grid.clear();
    const { image, mm } = this.#picture;
    const pictured = image && mm > 0;
    if (pictured) lay(pen, width * scale, height * scale, image, mm, (BAR_PX * scale) / this.#mm);
    pen.strokeStyle = colour(pictured ? "--over" : "--grid");
    pen.lineWidth = 1;
    pen.beginPath();
    const step = (10 * BAR_PX) / this.#mm;
    for (let x = (width / 2) % step; x < width; x += step) {
      pen.moveTo(Math.round(x) + 0.5, 0);
      pen.lineTo(Math.round(x) + 0.5, height);
    }
    for (let y = (height / 2) % step; y < height; y += step) {
      pen.moveTo(0, Math.round(y) + 0.5);
      pen.lineTo(width, Math.round(y) + 0.5);
    }
    pen.stroke();
  }
}
