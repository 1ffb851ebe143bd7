// The setting that is played, and another one to compare it with. A setting is the materials, the live parameters and
// the strength.
import { Levels } from "./levels.js";
import { figure, write } from "./draw.js";

/// A value from the run that is older than what was asked of it here is not taken over.
const SETTLE_MS = 600;
/// After a change the texture of before still sounds for a while.
const STALE_MS = 200;

const key = (node, param) => `${node}\n${param}`;

export class Setting {
  #link;
  #knob = document.getElementById("strength");
  #now = document.getElementById("strength-now");
  #buttons = [document.getElementById("slot-a"), document.getElementById("slot-b")];
  #match = document.getElementById("match");
  #matched = document.getElementById("matched");
  /// Both settings; the second is a copy of the first until it is chosen.
  #slots = [{ materials: {}, params: {}, strength: 1, levels: new Levels() }, null];
  #at = 0;
  #layout = null;
  /// Until then, layouts show the way from one setting to the other.
  #until = 0;
  #asked = { strength: 1, at: -SETTLE_MS };
  #waits = false;
  #changed = 0;

  constructor(link) {
    this.#link = link;
    this.#knob.addEventListener("input", () => {
      this.#here.strength = Number(this.#knob.value) / 100;
      this.#tell();
    });
    this.#buttons.forEach((button, at) => button.addEventListener("click", () => this.#swap(at)));
    this.#match.addEventListener("change", () => this.#tell());
    this.#show();
  }

  /** The strength that was asked of the run last. */
  get strength() {
    return this.#asked.strength;
  }

  get #here() {
    return this.#slots[this.#at];
  }

  layout(layout) {
    this.#layout = layout;
    const now = current(layout);
    const asked = this.#here;
    const same = JSON.stringify([now.materials, now.params]) === JSON.stringify([asked.materials, asked.params]);
    if (performance.now() < this.#until && !same) return;
    this.#until = 0;
    if (!same) {
      // Another texture has another level.
      this.#slots[this.#at] = { ...now, strength: asked.strength, levels: new Levels() };
      this.#changed = performance.now();
    }
    this.#show();
  }

  /** The figures of a view: its strength, and the new samples of speed, force and acceleration. */
  take(strength, speed, force, acceleration, rate) {
    const now = performance.now();
    if (now - this.#asked.at > SETTLE_MS && Math.abs(strength - this.#asked.strength) > 1e-4) {
      // Another page moved it.
      this.#asked.strength = strength;
      this.#here.strength = Math.min(1, strength / this.#lowered(this.#at));
    }
    const still = now - Math.max(this.#changed, this.#asked.at) > STALE_MS && now > this.#until;
    if (still) this.#here.levels.take(strength, speed, force, acceleration, rate);
  }

  /** Writes the figures, and follows a level that is known better by now. */
  show() {
    this.#tell();
  }

  /** A person changes the setting, also while it is on its way. */
  touched() {
    if (this.#until !== Infinity) this.#until = 0;
  }

  /** There is no connection: what comes next may be another run. */
  lost() {
    this.#until = Infinity;
  }

  /** There is one again. A run that has begun anew gets the setting, another one knows better. */
  found(anew) {
    this.#until = 0;
    if (anew) this.#apply();
    else this.layout(this.#layout);
  }

  #swap(to) {
    if (to === this.#at) return;
    this.#slots[to] ??= { ...structuredClone({ ...this.#here, levels: null }), levels: this.#here.levels.copy() };
    this.#at = to;
    this.#apply();
  }

  #apply() {
    const { materials, params } = this.#here;
    const now = current(this.#layout);
    const asks = [];
    for (const [node, name] of Object.entries(materials)) {
      if (node in now.materials && now.materials[node] !== name) asks.push({ material: [name, node] });
    }
    for (const [id, value] of Object.entries(params)) {
      const [node, param] = id.split("\n");
      if (id in now.params && now.params[id] !== value) asks.push({ set: [`${node}.${param}`, value] });
    }
    for (const ask of asks) this.#link.ask(ask);
    this.#until = asks.length ? performance.now() + 3000 : 0;
    this.#changed = performance.now();
    this.#asked.strength = NaN;
    this.#tell();
  }

  /** The difference of A and B in dB over strokes that both had alike; none before both were stroked enough. */
  #difference() {
    const [a, b] = this.#slots;
    const db = b && a.levels.against(b.levels);
    return db === null || !a.strength || !b.strength ? null : db + 20 * Math.log10(a.strength / b.strength);
  }

  /** The factor that brings the louder of the two to the level of the other. */
  #lowered(at) {
    const db = this.#match.checked ? this.#difference() : null;
    const louder = db > 0 ? 0 : 1;
    return db === null || at !== louder ? 1 : 10 ** (-Math.abs(db) / 20);
  }

  /** Asks for the strength with the next frame, if it is another. */
  #tell() {
    this.#show();
    if (this.#waits) return;
    this.#waits = true;
    requestAnimationFrame(() => {
      this.#waits = false;
      const strength = this.#here.strength * this.#lowered(this.#at);
      if (Math.abs(strength - this.#asked.strength) < 5e-3) return;
      this.#asked = { strength, at: performance.now() };
      this.#link.ask({ gain: [strength] });
    });
  }

  #show() {
    const percent = Math.round(100 * this.#here.strength);
    if (!this.#knob.matches(":active")) this.#knob.value = String(percent);
    this.#knob.style.setProperty("--part", `${percent}%`);
    this.#knob.setAttribute("aria-valuetext", `${percent} %`);
    write(this.#now, `${percent} %`);
    this.#slots.forEach((slot, at) => {
      const button = this.#buttons[at];
      button.setAttribute("aria-pressed", String(at === this.#at));
      const names = slot ? Object.values(slot.materials).join(", ") : "";
      write(button.querySelector("span"), slot ? [names, `${Math.round(100 * slot.strength)} %`].filter(Boolean).join(", ") : "empty");
    });
    write(this.#matched, this.#says());
  }

  #says() {
    const [a, b] = this.#slots;
    if (!b) return "Choose B, then another material: the setting A stays to compare.";
    const db = this.#difference();
    if (db === null) {
      const [has, wants] = [a.levels.alike(b.levels), Levels.ENOUGH_S];
      return `Not yet measured: stroke A and B alike (${figure(has)} of ${wants} s; A ${figure(a.levels.seconds)} s, B ${figure(b.levels.seconds)} s).`;
    }
    const [louder, by] = [db > 0 ? "A" : "B", Math.abs(db).toFixed(1)];
    return this.#match.checked ? `${louder} is lowered by ${by} dB.` : `${louder} is ${by} dB louder.`;
  }
}

/** Materials and parameters of a layout. */
function current({ materials, nodes }) {
  return {
    materials: Object.fromEntries(materials.map(({ node, chosen }) => [node, chosen])),
    params: Object.fromEntries(nodes.flatMap(({ id, live }) => live.map(({ name, value }) => [key(id, name), value]))),
  };
}
