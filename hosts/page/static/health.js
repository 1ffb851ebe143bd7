// Losses, latency and sources.
import { count, figure, make, write } from "./draw.js";

const TALLIES = [
  ["underruns", "Callbacks that found too few samples"],
  ["lost_samples", "Samples of each channel that were never played"],
  ["xruns", "Gaps and overruns that the host or the watchdog saw"],
  ["losses", "How often the device was lost"],
  ["faults", "Faults of all nodes"],
];
/// Time that a risen count is highlighted.
const NEW_MS = 3000;

export class Health {
  #tallies = new Map();
  #latency;
  #sources;
  #items = "";
  #rows = new Map();
  #peak;

  constructor(tallies, latency, sources) {
    this.#latency = latency;
    this.#sources = sources;
    for (const [name, title] of TALLIES) {
      const box = make("div", "tally");
      const value = make("output", "figure", "0");
      box.title = title;
      box.append(value, make("span", "quiet", name.replace("_", " ")));
      tallies.append(box);
      this.#tallies.set(name, { box, value, last: null, grew: -Infinity });
    }
    const peak = make("div", "tally");
    peak.title = "Greatest sample of the output, of full scale";
    this.#peak = make("output", "figure", "–");
    peak.append(this.#peak, make("span", "quiet", "peak"));
    tallies.append(peak);
  }

  show(view) {
    const now = performance.now();
    for (const [name, tally] of this.#tallies) {
      const value = view[name] ?? 0;
      if (tally.last !== null && value > tally.last) tally.grew = now;
      tally.last = value;
      write(tally.value, count(value));
      tally.box.classList.toggle("some", value > 0);
      tally.box.classList.toggle("new", now - tally.grew < NEW_MS);
    }
    write(this.#peak, view.peak > 1e-6 ? `${(20 * Math.log10(view.peak)).toFixed(1).replace("-", "−")} dB` : "silent");
    this.#itemise(view.latency_ms);
    this.#list(view.sources);
  }

  #itemise(latency) {
    const items = JSON.stringify(latency);
    if (items === this.#items) return;
    this.#items = items;
    const total = latency.reduce((sum, [, ms]) => sum + ms, 0);
    const bar = make("div", "parts");
    const list = make("dl", "items");
    latency.forEach(([what, ms], i) => {
      const part = make("i", `part part-${i % 6}`);
      part.style.flexGrow = String(Math.max(0, ms));
      if (ms > 0) bar.append(part);
      const name = make("dt");
      name.append(make("i", `dot part-${i % 6}`), what);
      list.append(name, make("dd", "figure", `${ms.toFixed(2).replace("-", "−")} ms`));
    });
    if (latency.length) list.append(make("dt", "sum", "together"), make("dd", "figure sum", `${total.toFixed(2)} ms`));
    this.#latency.replaceChildren(...(latency.length ? [bar, list] : [make("p", "quiet", "not known")]));
  }

  #list(sources) {
    const ids = sources.map((source) => source.id);
    if (ids.length !== this.#rows.size || ids.some((id) => !this.#rows.has(id))) this.#table(ids);
    for (const source of sources) {
      const cells = this.#rows.get(source.id);
      const texts = [
        source.samples === 0 ? "waiting" : source.stalled ? "stalled" : "live",
        figure(source.rate_hz),
        figure(source.age_ms),
        figure(source.delay_ms),
        count(source.stalls),
      ];
      texts.forEach((text, i) => write(cells[i], text));
      cells[0].className = source.stalled && source.samples > 0 ? "bad" : "";
    }
  }

  #table(ids) {
    this.#rows.clear();
    if (!ids.length) return this.#sources.replaceChildren(make("p", "quiet", "none"));
    const table = make("table");
    const head = make("tr");
    head.append(make("td"));
    for (const name of ["state", "Hz", "age ms", "delay ms", "stalls"]) head.append(make("th", "", name));
    table.append(head);
    for (const id of ids) {
      const row = make("tr");
      const cells = [0, 1, 2, 3, 4].map(() => make("td"));
      row.append(make("th", "", id), ...cells);
      table.append(row);
      this.#rows.set(id, cells);
    }
    this.#sources.replaceChildren(table);
  }
}
