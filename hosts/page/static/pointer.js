// A pointer on an element: its strokes are sent to the program at once, as samples of the hand.
const INCH_MM = 25.4;
/// Length of the bar that a person measures.
export const BAR_PX = 96;
/// A resting or lifted hand repeats its sample this often; a source stalls after 50 ms.
const BEAT_MS = 15;
/// Moves arrive late, by up to a frame. A repeated sample must not overtake them.
const BEHIND_MS = 8;

export class Pointer {
  /// Length of the bar in mm.
  mm = Number(localStorage.getItem("asperity.bar_mm")) || INCH_MM;
  /// Pressure of a pointer that has none.
  press = Number(localStorage.getItem("asperity.pressure")) || 0.4;
  /// Whether the program listens to a pointer.
  there = false;
  /// Which pointer touches, or null.
  pointer = null;
  /// The last place that was sent.
  last = null;
  /// The place at the middle of the surface in mm.
  middle = { x: 0, y: 0 };
  surface;
  #link;
  #mine = false;
  #stroke = Math.floor(Math.random() * 1e6);
  #said = 0;
  #box = null;
  #mouse = false;
  #glide = null;

  /** `link` tells the program numbers, `surface` is stroked. */
  constructor(link, surface) {
    this.#link = link;
    this.surface = surface;
    // Raw updates come at once, moves wait for the next frame. A browser has one or both: only one is used.
    const moves = "onpointerrawupdate" in window ? "pointerrawupdate" : "pointermove";
    surface.addEventListener("pointerdown", (event) => this.down(event));
    surface.addEventListener(moves, (event) => this.#move(event));
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) {
      surface.addEventListener(name, (event) => this.#up(event));
    }
    surface.addEventListener("wheel", (event) => this.#wheel(event), { passive: false });
    surface.addEventListener("contextmenu", (event) => event.preventDefault());
    surface.addEventListener("keydown", (event) => this.#key(event));
    surface.addEventListener("keyup", (event) => this.#keyUp(event));
    surface.addEventListener("blur", () => this.pointer === "keys" && this.lift(performance.now()));
    document.addEventListener("visibilitychange", () => document.hidden && this.free());
    addEventListener("pagehide", () => this.free());
    setInterval(() => this.beat(performance.now()), 5);
  }

  /** Takes each sample that is sent, and the number of its touch. */
  sent() {}

  /** Whether the program listens to a pointer. */
  offer(there) {
    this.there = there;
    this.surface.classList.toggle("deaf", !there);
  }

  /** Whose hand it is: yours, theirs or free. */
  held(whose) {
    this.#mine = whose === "yours";
  }

  linked(there) {
    if (there) return;
    this.held("free");
    this.pointer = null;
  }

  setPress(to) {
    this.press = Math.min(1, Math.max(0.02, to));
    localStorage.setItem("asperity.pressure", String(this.press));
  }

  /** The surface may have moved on the page. */
  moved() {
    this.#box = null;
  }

  /** A touch of another kind begins. */
  touch(pointer) {
    this.pointer = pointer;
    this.#stroke += 1;
  }

  #wheel(event) {
    event.preventDefault();
    this.setPress(this.press - Math.sign(event.deltaY) * 0.02);
  }

  /** Pens have a pressure. A mouse has none, nor has a finger on a screen that reports only 0, 0.5 or 1. */
  #pressure(event) {
    const felt = event.pointerType === "pen" || ![0, 0.5, 1].includes(event.pressure);
    return event.pointerType !== "mouse" && felt ? Math.min(1, event.pressure) : this.press;
  }

  #place(event) {
    // The place of the surface is read once a frame; a pen moves several times in one.
    this.#box ??= this.surface.getBoundingClientRect();
    const box = this.#box;
    const mm = this.mm / BAR_PX;
    return {
      at: event.timeStamp,
      x: (event.clientX - box.left - box.width / 2) * mm + this.middle.x,
      y: (box.top + box.height / 2 - event.clientY) * mm + this.middle.y,
      pressure: this.#pressure(event),
      tilt: tilt(event),
    };
  }

  down(event) {
    if (this.pointer !== null || !this.there || event.button !== 0) return;
    this.surface.setPointerCapture(event.pointerId);
    this.moved();
    this.#mouse = event.pointerType === "mouse";
    this.touch(event.pointerId);
    this.send([this.#place(event)]);
  }

  #move(event) {
    if (event.pointerId !== this.pointer) return;
    const all = event.getCoalescedEvents?.() ?? [];
    this.send((all.length ? all : [event]).map((one) => this.#place(one)));
  }

  #up(event) {
    if (event.pointerId !== this.pointer) return;
    this.pointer = null;
    const place = event.type === "pointerup" ? this.#place(event) : { ...this.last, at: event.timeStamp };
    this.send([{ ...place, pressure: 0 }]);
  }

  lift(at) {
    if (this.last) this.send([{ ...this.last, at, pressure: 0 }]);
    this.pointer = null;
  }

  /** Arrow keys stroke too: while one is held, the hand moves at 60 mm/s. */
  #key(event) {
    const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (!way || !this.there) return;
    event.preventDefault();
    if (event.repeat || (this.pointer !== null && this.pointer !== "keys")) return;
    if (this.pointer === null) this.touch("keys");
    this.#glide = { way, key: event.key, at: event.timeStamp, from: this.last ?? this.middle };
    this.send([{ at: event.timeStamp, x: this.#glide.from.x, y: this.#glide.from.y, pressure: this.press }]);
  }

  #keyUp(event) {
    if (this.pointer === "keys" && event.key === this.#glide.key) this.lift(event.timeStamp);
  }

  /** Sends what is due without an event: a key that is held, and a hand that rests. */
  beat(now) {
    if (this.pointer === "keys") {
      const { way, at, from } = this.#glide;
      const mm = ((now - at) / 1000) * 60;
      const box = this.surface.getBoundingClientRect();
      const scale = this.mm / BAR_PX;
      const fold = (x, size) => {
        const half = (size / 2) * scale;
        const turn = (((x + half) % (4 * half)) + 4 * half) % (4 * half);
        return (turn < 2 * half ? turn : 4 * half - turn) - half;
      };
      const middle = this.middle;
      const x = middle.x + fold(from.x - middle.x + way[0] * mm, box.width);
      const y = middle.y + fold(from.y - middle.y + way[1] * mm, box.height);
      this.send([{ at: now, x, y, pressure: this.press }]);
    } else if (this.#mine && this.last && now - this.#said >= BEAT_MS && !document.hidden) {
      // The wheel changes the pressure of a resting mouse.
      const pressure = this.#mouse && this.pointer !== null ? this.press : this.last.pressure;
      this.send([{ ...this.last, pressure, at: Math.max(now - BEHIND_MS, this.last.at) }]);
    }
  }

  send(places) {
    const numbers = new Float64Array(2 + 5 * places.length);
    const now = performance.now();
    numbers.set([1, now]);
    places.forEach((place, i) => {
      const at = Math.min(now, Math.max(place.at, this.last ? this.last.at + 0.01 : 0));
      this.last = { ...place, at };
      numbers.set([at, place.x, place.y, place.pressure, this.#stroke], 2 + 5 * i);
      this.sent(this.last, this.#stroke);
    });
    this.#said = now;
    this.#link.tell(numbers);
  }

  /** Lets the hand go. */
  free() {
    this.pointer = null;
    this.#mine = false;
    this.#link.tell(new Float64Array([2]));
  }
}

/** Tilt of a pen in degrees: to the right, and away from the person. */
function tilt({ pointerType, tiltX = 0, tiltY = 0, altitudeAngle, azimuthAngle }) {
  if (pointerType !== "pen") return [0, 0];
  if (tiltX || tiltY || !(altitudeAngle < Math.PI / 2)) return [tiltX, -tiltY];
  // How far the pen leans over for its height.
  const lean = 1 / Math.tan(Math.max(altitudeAngle, 0.01));
  const degrees = (x) => (Math.atan(x * lean) * 180) / Math.PI;
  return [degrees(Math.cos(azimuthAngle)), -degrees(Math.sin(azimuthAngle))];
}
