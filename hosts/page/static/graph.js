// The running graph: a box for each node with its outputs, cost and state.
import { count, figure, write } from "./draw.js";
import { place } from "./layers.js";

const NODE = 174;
/// A narrower box has no room for two names in a row.
const NARROW = 150;
const HEAD = 40;
const ROW = 16;
const PAD = 8;
const SVG = "http://www.w3.org/2000/svg";
/// A node without a call in so many updates is asleep.
const ASLEEP = 2;

function svg(tag, attributes = {}, text = "") {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  if (text) element.textContent = text;
  return element;
}

/** Cuts a text to about so many characters. */
const cut = (text, most) => (text.length > most ? `${text.slice(0, most - 1)}…` : text);

export class Graph {
  #box;
  #note;
  #layout = null;
  #nodes = [];
  #wires = [];
  #width = 0;
  #view = null;

  constructor(box, note) {
    this.#box = box;
    this.#note = note;
    new ResizeObserver(() => {
      const width = Math.floor(box.clientWidth);
      if (width && width !== this.#width) {
        this.#width = width;
        this.#build();
      }
    }).observe(box);
  }

  layout(layout) {
    this.#layout = layout;
    this.#build();
  }

  #build() {
    const layout = this.#layout;
    if (!layout || !this.#width) return;
    // Two columns on a phone are better than one.
    const wide = this.#width < 420 ? Math.max(116, (this.#width - 74) / 2) : NODE;
    const rows = (node) => Math.max(under(node, wide) + node.outputs.length, several(node) ? node.inputs.length : 0, 1);
    const sizes = layout.nodes.map((node) => HEAD + rows(node) * ROW + PAD);
    const placed = place(sizes, layout.wires, this.#width - 2, wide);
    const root = svg("svg", {
      viewBox: `-1 -1 ${placed.width + 2} ${placed.height + 2}`,
      width: placed.width + 2,
      height: placed.height + 2,
      role: "img",
      "aria-label": `Graph of ${layout.nodes.length} nodes`,
    });
    this.#wires = layout.wires.map((wire, i) => {
      const path = svg("path", { class: placed.routes[i].back ? "wire back" : "wire", d: line(wire, placed, i, layout.nodes) });
      root.append(path);
      return path;
    });
    const wired = new Set(layout.wires.map(([, , to, input]) => `${to} ${input}`));
    this.#nodes = layout.nodes.map((node, i) => {
      const drawn = box(node, placed.places[i], wide, (input) => wired.has(`${i} ${input}`));
      root.append(drawn.group);
      // The tooltip is written only while someone points at the node.
      drawn.group.addEventListener("pointerenter", () => this.#tell(i));
      return { ...drawn, calls: null, idle: 0, stands: "" };
    });
    this.#box.replaceChildren(root);
  }

  show(view) {
    this.#view = view;
    // There are no nodes before the page has a width.
    if (!this.#nodes.length) return;
    let asleep = 0;
    view.nodes.forEach((now, i) => {
      const node = this.#nodes[i];
      if (!node) return;
      node.idle = now.calls === node.calls && node.calls !== null ? node.idle + 1 : 0;
      node.calls = now.calls;
      const state = now.quarantined ? "quarantined" : node.idle >= ASLEEP ? "asleep" : "awake";
      asleep += state === "asleep";
      const stands = `node ${state}${now.faults ? " faulty" : ""}`;
      if (node.stands !== stands) node.group.setAttribute("class", (node.stands = stands));
      write(node.us, state === "awake" ? `${figure(now.us)} µs` : state);
      const faults = now.faults ? `${count(now.faults)} ${now.faults === 1 ? "fault" : "faults"}` : "";
      write(node.faults, faults);
      write(node.id, node.names[now.faults ? 1 : 0]);
      node.outputs.forEach((output, k) => write(output, figure(now.values[k])));
      if (node.group.matches(":hover")) this.#tell(i);
    });
    this.#layout.wires.forEach(([from], i) => {
      const still = this.#nodes[from].idle >= ASLEEP || view.nodes[from]?.quarantined;
      this.#wires[i].classList.toggle("still", Boolean(still));
    });
    const all = view.nodes.reduce((sum, node) => sum + (node.us ?? 0), 0);
    write(this.#note, `${view.nodes.length - asleep} of ${view.nodes.length} nodes awake, ${figure(all)} µs a tick`);
  }

  /** Writes the tooltip of a node: its totals. */
  #tell(i) {
    const now = this.#view?.nodes[i];
    if (!now) return;
    const { id, kind } = this.#layout.nodes[i];
    const lines = [`${id}: ${kind}`, `mean ${figure(now.us)} µs, longest ${figure(now.max_us)} µs`,
      `${count(now.calls)} calls, slept through ${count(now.slept)} ticks`];
    if (now.faults) lines.push(`${count(now.faults)} faults; last: ${now.last_fault}`);
    write(this.#nodes[i].title, lines.join("\n"));
  }
}

/** Whether the inputs of a node have their names beside them. */
const several = (node) => node.inputs.length > 1;

/** Rows above the first output. In a narrow box, outputs stand below the inputs. */
const under = (node, wide) => (wide < NARROW && several(node) ? node.inputs.length : 0);

function box(node, { x, y, height }, wide, wired) {
  const group = svg("g", { class: "node", transform: `translate(${x} ${y})` });
  const title = svg("title");
  group.append(title, svg("rect", { class: node.sink ? "box sink" : "box", width: wide, height, rx: 5 }));
  // Room beside the name for faults.
  const names = [18, 78].map((rest) => cut(node.id, Math.floor((wide - rest) / 6.6)));
  const id = svg("text", { class: "id", x: 9, y: 17 }, names[0]);
  group.append(id);
  group.append(svg("text", { class: "kind", x: 9, y: 31 }, cut(node.kind, Math.floor((wide - 70) / 5.7))));
  const us = svg("text", { class: "us", x: wide - 9, y: 31, "text-anchor": "end" });
  const faults = svg("text", { class: "faults", x: wide - 9, y: 17, "text-anchor": "end" });
  group.append(us, faults);
  node.inputs.forEach(([name], k) => {
    const at = HEAD + k * ROW + ROW / 2;
    group.append(svg("circle", { class: "port", cx: 0, cy: at, r: 2.5 }));
    // An unwired input has a dot but no name.
    if (several(node) && wired(k)) group.append(svg("text", { class: "port-name", x: 9, y: at + 4 }, cut(name, 8)));
  });
  const outputs = node.outputs.map(([name, unit], k) => {
    const at = HEAD + (under(node, wide) + k) * ROW + ROW / 2;
    group.append(svg("circle", { class: "port", cx: wide, cy: at, r: 2.5 }));
    const text = svg("text", { class: "out", x: wide - 9, y: at + 4, "text-anchor": "end" });
    const value = svg("tspan", { class: "value" }, "–");
    const beside = several(node) && !under(node, wide) && k < node.inputs.length && wired(k);
    const taken = beside ? Math.min(8, node.inputs[k][0].length) + 1 : 0;
    const most = Math.min(12, Math.max(4, Math.floor((wide - 18) / 5.9) - taken - unit.length - 8));
    text.append(svg("tspan", { class: "port-name" }, `${cut(name, most)} `));
    text.append(value, svg("tspan", { class: "unit" }, unit ? ` ${unit}` : ""));
    group.append(text);
    return value;
  });
  return { group, title, id, names, us, faults, outputs };
}

/** The path of a wire: curves between columns, square corners from band to band and back. */
function line([from, output, to, input], placed, i, nodes) {
  const { places, routes, nodeWidth } = placed;
  const port = (node, k, x) => {
    const slot = places[node];
    return { x: slot.x + x, y: slot.y + HEAD + k * ROW + ROW / 2, band: slot.band };
  };
  const { back, slots, net } = routes[i];
  const points = [port(from, under(nodes[from], nodeWidth) + output, nodeWidth)];
  for (const { x, y, height, band } of slots) {
    points.push({ x, y: y + height / 2, band }, { x: x + nodeWidth, y: y + height / 2, band });
  }
  points.push(port(to, input, 0));
  let path = `M${points[0].x} ${points[0].y}`;
  for (let k = 1; k < points.length; k += 1) {
    const [a, b] = [points[k - 1], points[k]];
    if (back || a.band !== b.band) path += corners(a, b, placed, net);
    else path += a.y === b.y ? `H${b.x}` : curve(a, b);
  }
  return path;
}

function curve(a, b) {
  const middle = (a.x + b.x) / 2;
  return `C${middle} ${a.y} ${middle} ${b.y} ${b.x} ${b.y}`;
}

/** Out to the gap beside the column, down below the band, along it, and in. Each net has its own lane. */
function corners(a, b, { bands, lane }, net) {
  const { bottom, nets } = bands[a.band];
  const at = nets.indexOf(net);
  const y = bottom + 11 + lane * at;
  const right = a.x + 8 + lane * at;
  const left = b.x - 8 - lane * (nets.length - 1 - at);
  const down = b.y > y ? 1 : -1;
  const r = 3;
  return `H${right - r}q${r} 0 ${r} ${r}V${y - r}q0 ${r} ${-r} ${r}H${left + r}q${-r} 0 ${-r} ${r * down}`
    + `V${b.y - r * down}q0 ${r * down} ${r} ${r * down}H${b.x}`;
}
