// The last strokes: kept, saved, played again by this hand, and rendered again by the run.
import { figure, make, write } from "./draw.js";
import { address } from "./link.js";

/// Most strokes that are kept, most rows of one, and its longest time.
const STROKES = 8;
const ROWS = 60000;
const LONGEST_S = 120;
/// Samples closer than this are left out.
const NEAR_S = 0.0019;
/// A shorter touch is no stroke.
const LEAST_S = 0.05;
const ASK_MS = 150;

export class Strokes {
  #hand;
  #box;
  #kept = [];
  #now = null;
  #count = 0;
  #rendering = false;
  #parts = {};

  constructor(box, hand) {
    this.#box = box;
    this.#hand = hand;
    hand.onSample = (place, touch) => this.#take(place, touch);
  }

  /** Whether there is something to stroke. */
  offer(there) {
    if (!there) this.#box.replaceChildren();
    else if (!this.#box.firstChild) this.#build();
  }

  #take({ at, x, y, pressure, tilt = [0, 0] }, touch) {
    if (this.#now?.touch !== touch) {
      // A lifted hand says again and again where it rests.
      if (pressure === 0) return;
      this.#end();
      this.#now = { touch, from: at, rows: [] };
    }
    const t = (at - this.#now.from) / 1000;
    const last = this.#now.rows.at(-1);
    if (t > LONGEST_S || this.#now.rows.length >= ROWS) return;
    if ((last && t <= last[0]) || (last && pressure > 0 && t - last[0] < NEAR_S)) return;
    this.#now.rows.push([t, x, y, pressure, ...tilt]);
    if (pressure === 0) this.#end();
  }

  #end() {
    const rows = this.#now?.rows ?? [];
    this.#now = null;
    const seconds = rows.at(-1)?.[0] ?? 0;
    if (seconds < LEAST_S) return;
    this.#count += 1;
    const way = rows.reduce((sum, [, x, y], i) => sum + (i ? Math.hypot(x - rows[i - 1][1], y - rows[i - 1][2]) : 0), 0);
    const name = `Stroke ${this.#count}: ${figure(seconds)} s, ${figure(way)} mm`;
    this.#kept.unshift({ name, number: this.#count, rows });
    this.#kept.length = Math.min(this.#kept.length, STROKES);
    if (this.#kept.length === 1) write(this.#parts.said, "");
    this.#list();
  }

  #build() {
    const head = make("div", "head");
    head.append(make("h2", "", "Strokes"));
    const choice = make("select");
    choice.setAttribute("aria-label", "Stroke");
    const button = (text, act) => {
      const it = make("button", "", text);
      it.type = "button";
      it.addEventListener("click", act);
      return it;
    };
    const again = button("Play again", () => this.#again());
    const save = button("Save stroke", () => this.#save());
    const render = button("Render again", () => this.#render());
    const buttons = make("div", "buttons");
    buttons.append(again, save, render);
    const said = make("p", "quiet");
    said.setAttribute("role", "status");
    const result = make("div", "result");
    this.#parts = { choice, again, save, render, said, result };
    this.#box.replaceChildren(head, choice, buttons, said, result);
    this.#list();
  }

  #list() {
    const { choice, again, save, render, said } = this.#parts;
    if (!choice) return;
    choice.replaceChildren(...this.#kept.map(({ name, number }) => new Option(name, String(number))));
    const none = !this.#kept.length;
    choice.hidden = none;
    for (const button of [again, save]) button.disabled = none;
    render.disabled = none || this.#rendering;
    if (none) write(said, "Your last strokes stand here, to save them, or to play and render them again.");
  }

  get #chosen() {
    return this.#kept.find(({ number }) => String(number) === this.#parts.choice.value);
  }

  #again() {
    const { again, said } = this.#parts;
    if (again.textContent === "Stop playing") return this.#hand.endAgain();
    const begun = this.#hand.again(this.#chosen.rows, () => (again.textContent = "Play again"));
    if (begun) again.textContent = "Stop playing";
    else write(said, "The hand is in use.");
  }

  /** Sends the chosen stroke somewhere. Throws what the run says against it. */
  async #post(path, { rows }) {
    const answer = await fetch(address(path), { method: "POST", body: Float64Array.from(rows.flat()) });
    if (!answer.ok) throw new Error(await answer.text());
    return answer;
  }

  async #save() {
    const stroke = this.#chosen;
    try {
      const link = make("a");
      link.href = URL.createObjectURL(await (await this.#post("/stroke.csv", stroke)).blob());
      link.download = `stroke${stroke.number}.csv`;
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 60000);
      write(this.#parts.said, `Saved. To render it: asperity render GRAPH --input ${link.download} --out out.wav`);
    } catch (error) {
      this.#failed(error);
    }
  }

  async #render() {
    const stroke = this.#chosen;
    this.#rendering = true;
    this.#list();
    write(this.#parts.said, "The run renders the stroke.");
    try {
      const { number } = await (await this.#post("/render", stroke)).json();
      for (;;) {
        const now = await (await fetch(address("/render"))).json();
        if (now.number !== number) throw new Error("Another stroke was rendered meanwhile.");
        if (now.state === "failed") throw new Error(now.why);
        if (now.state === "done") {
          this.#done(stroke, number, now.report);
          break;
        }
        await new Promise((go) => setTimeout(go, ASK_MS));
      }
    } catch (error) {
      this.#failed(error);
    }
    this.#rendering = false;
    this.#list();
  }

  #failed(error) {
    write(this.#parts.said, error instanceof TypeError ? "There is no connection to the run." : error.message);
  }

  /** Offers a render to play and to download, with its figures. */
  #done(stroke, number, { output, latency, seconds }) {
    const source = `${address("/render.wav")}&number=${number}`;
    const sound = make("audio");
    Object.assign(sound, { controls: true, src: source, volume: 0.5 });
    sound.setAttribute("aria-label", `Render of stroke ${stroke.number}`);
    const link = make("a", "", `stroke${stroke.number}.wav`);
    Object.assign(link, { href: source, download: link.textContent });
    const figures = `peak ${figure(output.peak)} ${output.unit}, rms ${figure(output.rms)} ${output.unit}; ${latency.line}`;
    this.#parts.result.replaceChildren(sound, link, make("p", "quiet", figures));
    write(this.#parts.said, `Stroke ${stroke.number} is rendered: ${figure(seconds)} s with the present material and parameters, at full strength.`);
  }
}
