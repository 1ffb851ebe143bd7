// Live parameters.
import { make } from "./draw.js";

/// A positive range whose ends have this ratio or more is logarithmic.
const WIDE = 300;
const STEPS = 1000;

export class Controls {
  #box;
  #link;
  #layout = null;
  /// The newest value of each parameter, to be sent with the next frame.
  #waiting = new Map();
  #shown = new Map();

  constructor(box, link) {
    this.#box = box;
    this.#link = link;
  }

  layout(layout, same) {
    this.#layout = layout;
    if (same) this.#refresh();
    else this.#build();
  }

  /** A request was refused: shows the true values again. */
  refused() {
    if (this.#layout) this.#refresh(true);
  }

  #build() {
    this.#shown.clear();
    const groups = this.#layout.nodes.filter((node) => node.live.length).map((node) => {
      const group = make("fieldset");
      group.append(make("legend", "", node.id), ...node.live.map((live) => this.#explained(node.id, live)));
      return group;
    });
    const none = make("p", "quiet", "This graph has no parameters that may change while it runs.");
    this.#box.replaceChildren(...(groups.length ? groups : [none]));
  }

  #refresh(force = false) {
    for (const node of this.#layout.nodes) {
      for (const live of node.live) this.#shown.get(`${node.id}\n${live.name}`)?.(live.value, force);
    }
  }

  #control(node, live) {
    if (live.words.length === 2 && live.words[0] === "off" && live.words[1] === "on") return this.#flag(node, live);
    return live.words.length ? this.#choice(node, live) : this.#slider(node, live);
  }

  /** A control with the meaning of its parameter. */
  #explained(node, live) {
    const box = make("div", "param");
    box.append(this.#control(node, live));
    if (live.doc) box.append(make("p", "quiet", live.doc));
    return box;
  }

  #flag(node, live) {
    const field = make("label", "field");
    const box = make("input");
    box.type = "checkbox";
    box.checked = live.value !== 0;
    box.addEventListener("change", () => this.#set(node, live.name, Number(box.checked)));
    this.#shown.set(`${node}\n${live.name}`, (value) => (box.checked = value !== 0));
    field.append(make("span", "", words(live)), box);
    return field;
  }

  #choice(node, live) {
    const field = make("label", "field");
    const select = make("select");
    live.words.forEach((word, i) => select.append(new Option(word, String(i))));
    select.value = String(live.value);
    select.addEventListener("change", () => this.#set(node, live.name, Number(select.value)));
    this.#shown.set(`${node}\n${live.name}`, (value) => (select.value = String(value)));
    field.append(make("span", "", words(live)), select);
    return field;
  }

  /** A slider over the useful range, and a number over the allowed range. */
  #slider(node, live) {
    const field = make("label", "field");
    const range = make("input");
    const typed = make("input");
    const now = make("span", "figure");
    const [least, most] = live.reach ?? [live.least, live.most];
    const scale = scaled({ least, most, whole: live.whole });
    Object.assign(range, { type: "range", min: 0, max: scale.steps, step: 1 });
    range.dataset.param = `${node}.${live.name}`;
    Object.assign(typed, { type: "number", min: live.least, max: live.most, step: live.whole ? 1 : "any" });
    typed.setAttribute("aria-label", `${node} ${words(live)}${live.unit ? ` in ${live.unit}` : ""}`);
    now.append(typed, live.unit);
    const write = (value) => {
      typed.value = String(Number(value.toPrecision(4)));
      range.setAttribute("aria-valuetext", `${typed.value} ${live.unit}`.trim());
    };
    const show = (value) => {
      range.value = String(Math.round(scale.to(value)));
      write(value);
    };
    let held = live.value;
    range.addEventListener("input", () => {
      held = scale.from(Number(range.value));
      write(held);
      this.#set(node, live.name, held);
    });
    typed.addEventListener("change", () => {
      const value = typed.value === "" ? NaN : Number(typed.value);
      if (Number.isFinite(value)) {
        held = Math.min(live.most, Math.max(live.least, live.whole ? Math.round(value) : value));
        this.#set(node, live.name, held);
      }
      show(held);
    });
    // A control in use is not set back by an older value from the run.
    this.#shown.set(`${node}\n${live.name}`, (value, force) => {
      held = value;
      if (force || !(range.matches(":active") || typed.matches(":focus"))) show(value);
    });
    show(live.value);
    field.append(make("span", "", words(live)), range, now);
    return field;
  }

  #set(node, param, value) {
    if (!this.#waiting.size) requestAnimationFrame(() => this.#send());
    this.#waiting.set(`${node}\n${param}`, { set: [`${node}.${param}`, value] });
  }

  #send() {
    for (const what of this.#waiting.values()) this.#link.ask(what);
    this.#waiting.clear();
  }
}

/** The name of a parameter in words, without its unit: that stands behind the value. */
function words({ name, unit }) {
  const plain = (text) => text.toLowerCase().replace(/\bper\b|[^a-z0-9]+/g, "");
  const parts = name.split("_");
  const said = unit && plain(unit) ? parts.findIndex((_, i) => i > 0 && plain(parts.slice(i).join(" ")) === plain(unit)) : -1;
  return (said > 0 ? parts.slice(0, said) : parts).join(" ");
}

/** Conversion between a value and the place of a slider: linear or logarithmic. */
function scaled({ least, most, whole }) {
  if (whole && most - least <= 2 * STEPS) {
    return { steps: most - least, to: (value) => value - least, from: (at) => least + at };
  }
  const factors = least > 0 && most / least > WIDE;
  const tidy = (value) => {
    const kept = Math.min(most, Math.max(least, Number(value.toPrecision(4))));
    return whole ? Math.round(kept) : kept;
  };
  if (factors) {
    const all = Math.log(most / least);
    return {
      steps: STEPS,
      to: (value) => (STEPS * Math.log(value / least)) / all,
      from: (at) => tidy(least * Math.exp((all * at) / STEPS)),
    };
  }
  return {
    steps: STEPS,
    to: (value) => (STEPS * (value - least)) / (most - least),
    from: (at) => tidy(least + ((most - least) * at) / STEPS),
  };
}
