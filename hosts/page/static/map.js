// A scene from above: its surfaces at true scale under the hand, the stylus, and what is felt.
import { canvas, colour, count, figure, make, write } from "./draw.js";
import { address } from "./link.js";

const TRAIL_MS = 1000;
/// A longer way from one view to the next is no motion.
const JUMP_MM = 40;
/// Least width of a surface that is named, and height of a line, in pixels.
const NAMED_PX = 34;
const LINE = 14;
/// Most surfaces in the list.
const LISTED = 60;
/// Outputs of the node that finds what is touched.
const CONTACT = ["surface", "volume", "force", "depth", "speed"];

export class SceneMap {
  #box;
  #hand;
  #ground = layer("map-surfaces");
  #stylus = layer("map-stylus");
  #layout = null;
  #number = 0;
  /// Surfaces, those of the largest area first, and what the server said of all.
  #surfaces = [];
  #map = null;
  #asked = "";
  /// What the surfaces were drawn for.
  #drawn = "";
  #trail = [];
  #last = null;
  #touched = [];
  #calls = new Map();
  #parts = {};

  constructor(box, hand) {
    this.#box = box;
    this.#hand = hand;
  }

  /** Another layout: `number` counts the scenes, 0 for none. */
  layout(layout, number) {
    this.#layout = layout;
    this.#box.hidden = !number;
    if (!number) this.#map = null;
    if (number === this.#number) return;
    this.#number = number;
    this.#asked = "";
    this.#drawn = "";
    if (!number) this.#surfaces = [];
  }

  /** Fetches the part of the scene around the middle of the view. */
  async #fetch() {
    const { x, y } = this.#hand.view;
    const asked = `${this.#number} ${x} ${y}`;
    const whole = this.#map && this.#map.surfaces.length === this.#map.all;
    if (!this.#number || asked === this.#asked || (whole && this.#asked)) return;
    this.#asked = asked;
    try {
      const answer = await fetch(`${address("/map")}&x=${x}&y=${y}`);
      if (!answer.ok || asked !== this.#asked) return;
      const first = !this.#map;
      this.#map = await answer.json();
      this.#surfaces = this.#map.surfaces.map(bounded).sort((a, b) => b.area - a.area);
      this.#drawn = "";
      this.#build();
      if (first) this.#hand.look(...this.#map.middle);
    } catch {
      // No server: the page says that already.
    }
  }

  /** Writes what is felt. */
  show(view) {
    if (!this.#map || view.layout !== this.#layout.number) return;
    const { felt } = this.#parts;
    const now = this.#contact(view);
    const names = this.#touched.map((number) => this.#map.surfaces.find((one) => one.number === number) ?? { name: `surface ${number}` });
    const said = names.map(({ name, material }) => (material ? `${name} (${material})` : name));
    write(felt.touches, said.join(" and ") || "nothing");
    write(felt.force, `${figure(now.force)} N`);
    write(felt.depth, `${figure(now.depth)} mm`);
    write(felt.speed, `${figure(now.speed)} mm/s`);
    const active = this.#active(view);
    write(felt.active, active.join(", ") || "none");
    for (const [number, button] of this.#parts.buttons) button.classList.toggle("touched", this.#touched.includes(number));
  }

  #contact(view) {
    const at = this.#layout.nodes.findIndex(({ outputs }) => CONTACT.every((name) => outputs.some(([one]) => one === name)));
    const values = view.nodes[at]?.values ?? [];
    const value = (name) => values[this.#layout.nodes[at]?.outputs.findIndex(([one]) => one === name)];
    return Object.fromEntries(CONTACT.map((name) => [name, value(name)]));
  }

  /** Effects whose nodes are called, and what a wall is by itself. */
  #active(view) {
    const now = new Map(this.#layout.nodes.map(({ id }, i) => [id, view.nodes[i]?.calls ?? 0]));
    // A node that falls asleep may be called once more.
    const called = (id) => now.get(id) > (this.#calls.get(id) ?? Infinity) + 1;
    const felt = this.#map.effects.filter(({ nodes }) => nodes.some(called));
    this.#calls = now;
    const walls = this.#touched.flatMap((number) => this.#map.surfaces.find((one) => one.number === number)?.effects ?? []);
    return [...new Set([...walls.filter((name) => name === "stiffness" || name === "damping"), ...felt.map(({ name }) => name)])];
  }

  /** Builds the panel: figures, ways to move the view, and a list of the surfaces. */
  #build() {
    const { surfaces, all } = this.#map;
    const head = make("div", "head");
    const title = make("h2", "", "Scene");
    title.id = "map-title";
    this.#box.setAttribute("aria-labelledby", title.id);
    const shown = surfaces.length < all
      ? `${count(surfaces.length)} of ${count(all)} surfaces are drawn: the nearest to the middle`
      : `${count(all)} ${all === 1 ? "surface" : "surfaces"} from above, at true scale`;
    head.append(title, make("span", "quiet", shown));
    const felt = {};
    const figures = make("dl", "felt");
    for (const [key, name] of [["touches", "Touches"], ["force", "Force"], ["depth", "Penetration"], ["speed", "Speed"], ["active", "Active"]]) {
      const pair = make("div", key);
      felt[key] = make("dd", "", "–");
      pair.append(make("dt", "", name), felt[key]);
      figures.append(pair);
    }
    const ways = make("div", "ways");
    ways.setAttribute("role", "group");
    ways.setAttribute("aria-label", "Move the view");
    for (const [sign, name, x, y] of [["←", "left", -1, 0], ["→", "right", 1, 0], ["↑", "up", 0, 1], ["↓", "down", 0, -1]]) {
      const button = make("button", "", sign);
      button.type = "button";
      button.setAttribute("aria-label", `Move the view ${name}`);
      button.addEventListener("click", () => this.#move(x, y));
      ways.append(button);
    }
    const { x, y } = this.#hand.view;
    const far = ({ place }) => Math.hypot(place[0] - x, place[1] - y);
    const listed = surfaces.length > LISTED ? [...surfaces].sort((a, b) => far(a) - far(b)).slice(0, LISTED) : surfaces;
    const buttons = listed.map((one) => [one.number, this.#button(one)]);
    const list = make("ul", "surfaces");
    list.setAttribute("aria-label", "Surfaces. One that is pressed comes to the middle of the view");
    for (const [, button] of buttons) {
      const item = make("li");
      item.append(button);
      list.append(item);
    }
    const more = all - listed.length;
    this.#parts = { felt, buttons };
    this.#box.replaceChildren(head, figures, ways, list, ...(more > 0 ? [make("p", "quiet", `${count(more)} more are not listed: move the view.`)] : []));
  }

  #button({ number, name, material, effects, place }) {
    const button = make("button");
    button.type = "button";
    button.dataset.number = number;
    const lines = [make("b", "", name), make("span", "", material ?? "no material"), make("span", "quiet", effects.join(", ") || "no effect")];
    button.append(...lines);
    button.addEventListener("click", () => this.#hand.look(...place));
    return button;
  }

  /** Moves the view by half of its size. */
  #move(right, up) {
    const { scale, x, y } = this.#hand.view;
    const { width, height } = this.#ground.element.getBoundingClientRect();
    this.#hand.look(x + (right * width) / 2 / scale, y + (up * height) / 2 / scale);
  }

  draw(view) {
    this.#fetch();
    if (!this.#map || !view) {
      if (this.#drawn !== "nothing") {
        this.#ground.clear();
        this.#stylus.clear();
        this.#drawn = "nothing";
      }
      return;
    }
    if (view !== this.#last && view.layout === this.#layout.number) {
      this.#last = view;
      const { surface, volume } = this.#contact(view);
      this.#touched = [...new Set([surface, volume].filter((number) => number >= 0))];
      this.#follow(view.stylus_mm);
    }
    const at = this.#hand.view;
    const wanted = `${at.scale} ${at.x} ${at.y} ${this.#touched}`;
    if (wanted !== this.#drawn || this.#ground.resized()) {
      this.#drawn = wanted;
      this.#drawSurfaces(at);
    }
    this.#drawStylus(at);
  }

  #follow(place) {
    if (!place) return;
    const [x, y] = place;
    const before = this.#trail.at(-1);
    const jumps = !before || Math.hypot(x - before.x, y - before.y) > JUMP_MM;
    this.#trail.push({ x, y, jumps, at: performance.now() });
  }

  #drawSurfaces(at) {
    const { pen, width, height } = this.#ground.clear();
    const X = (x) => width / 2 + (x - at.x) * at.scale;
    const Y = (y) => height / 2 - (y - at.y) * at.scale;
    pen.lineJoin = "round";
    const seen = this.#surfaces.map((one) => ({ one, box: one.box && { left: X(one.box[0]), right: X(one.box[2]), top: Y(one.box[3]), bottom: Y(one.box[1]) } }))
      .filter(({ box }) => !box || (box.right > 0 && box.left < width && box.bottom > 0 && box.top < height));
    const touched = ({ one }) => this.#touched.includes(one.number);
    for (const of of [...seen.filter((x) => !touched(x)), ...seen.filter(touched)]) {
      const { one } = of;
      pen.beginPath();
      if (one.radius) pen.arc(X(one.place[0]), Y(one.place[1]), one.radius * at.scale, 0, 7);
      else if (one.outline) {
        one.outline.forEach(([x, y], i) => (i ? pen.lineTo(X(x), Y(y)) : pen.moveTo(X(x), Y(y))));
        pen.closePath();
      } else pen.rect(-2, -2, width + 4, height + 4);
      pen.globalAlpha = touched(of) ? 0.22 : 0.07;
      pen.fillStyle = touched(of) ? colour("--accent") : colour("--ink");
      pen.fill();
      pen.globalAlpha = 1;
      pen.setLineDash(one.soft ? [5, 4] : []);
      pen.lineWidth = touched(of) ? 2 : 1;
      pen.globalAlpha = touched(of) ? 1 : 0.5;
      pen.strokeStyle = touched(of) ? colour("--accent") : colour("--quiet");
      pen.stroke();
    }
    pen.globalAlpha = 1;
    pen.setLineDash([]);
    pen.textAlign = "left";
    pen.textBaseline = "top";
    const taken = [];
    for (const { one, box } of seen) this.#name(pen, one, box ?? { left: 0, right: width, top: 0, bottom: height }, { width, height }, taken);
  }

  /** Writes name, material and effects into a surface, as far as there is room. */
  #name(pen, { name, material, effects }, box, { width, height }, taken) {
    const [left, right] = [Math.max(box.left, 0) + 5, Math.min(box.right, width) - 5];
    const [top, bottom] = [Math.max(box.top, 0) + 5, Math.min(box.bottom, height) - 2];
    if (right - left < NAMED_PX || bottom - top < LINE) return;
    const lines = [name, material, ...effects].filter(Boolean);
    let y = top;
    // Names of surfaces that lie over each other stand below each other.
    for (let i = 0; i < taken.length; i += 1) {
      const one = taken[i];
      if (one.left < right && one.right > left && one.top < y + LINE && one.bottom > y) {
        y = one.bottom;
        i = -1;
      }
    }
    const begins = y;
    for (const [i, line] of lines.entries()) {
      if (y + LINE > bottom) break;
      pen.font = `${i ? "" : "600 "}11px system-ui, sans-serif`;
      pen.fillStyle = colour(i ? "--quiet" : "--ink");
      pen.fillText(cut(pen, line, right - left), left, y);
      y += LINE;
    }
    taken.push({ left, right, top: begins, bottom: y });
  }

  /** The stylus, and its way in the last second. */
  #drawStylus(at) {
    const now = performance.now();
    const old = this.#trail.findIndex((place) => now - place.at < TRAIL_MS);
    // The last place stays.
    this.#trail.splice(0, old < 0 ? Math.max(this.#trail.length - 1, 0) : old);
    const { pen, width, height } = this.#stylus.clear();
    const X = ({ x }) => width / 2 + (x - at.x) * at.scale;
    const Y = ({ y }) => height / 2 - (y - at.y) * at.scale;
    pen.strokeStyle = colour("--accent");
    pen.lineWidth = 2;
    this.#trail.forEach((to, i) => {
      const from = this.#trail[i - 1];
      if (!from || to.jumps) return;
      pen.globalAlpha = Math.max(0, 1 - (now - to.at) / TRAIL_MS);
      pen.beginPath();
      pen.moveTo(X(from), Y(from));
      pen.lineTo(X(to), Y(to));
      pen.stroke();
    });
    pen.globalAlpha = 1;
    const last = this.#trail.at(-1);
    if (!last) return;
    pen.beginPath();
    pen.arc(X(last), Y(last), 5, 0, 7);
    pen.fillStyle = this.#touched.length ? colour("--accent") : colour("--panel");
    pen.fill();
    pen.stroke();
  }
}

/** A canvas under the ink of the hand. */
function layer(id) {
  const element = make("canvas");
  element.id = id;
  document.getElementById("ink").before(element);
  return canvas(element);
}

/** A surface with its bounds and area in mm; a plane has none. */
function bounded(one) {
  const [x, y] = one.place;
  const r = one.radius;
  const points = r ? [[x - r, y - r], [x + r, y + r]] : one.outline;
  if (!points) return { ...one, box: null, area: Infinity };
  const [xs, ys] = [points.map(([a]) => a), points.map(([, b]) => b)];
  const box = [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)];
  return { ...one, box, area: (box[2] - box[0]) * (box[3] - box[1]) };
}

/** The beginning of a text that is at most so wide. */
function cut(pen, text, wide) {
  if (pen.measureText(text).width <= wide) return text;
  let n = text.length - 1;
  while (n > 1 && pen.measureText(`${text.slice(0, n)}…`).width > wide) n -= 1;
  return `${text.slice(0, n)}…`;
}
