// Computing time and lateness of ticks, against the deadline. Counts have a logarithmic scale: one deadline miss in
// a million ticks must be visible.
import { canvas, colour, count, figure, make, write } from "./draw.js";

const ROWS = [
  { name: "computing", counts: "compute_counts", figures: "compute_us", colour: "--compute" },
  { name: "woke late", counts: "late_counts", figures: "late_us", colour: "--late" },
];

export class Timing {
  #canvas;
  #deadline;
  #cells;

  constructor(element, table, deadline) {
    this.#canvas = canvas(element, true);
    this.#deadline = deadline;
    const body = table.tBodies[0];
    this.#cells = ROWS.map((row) => {
      const line = make("tr");
      const head = make("th");
      const dot = make("i", "dot");
      dot.classList.add(row.counts);
      head.append(dot, row.name);
      line.append(head, ...[0, 1, 2, 3].map(() => make("td")));
      body.append(line);
      return [...line.querySelectorAll("td")];
    });
  }

  show(timing, ticks) {
    const part = ticks ? (100 * timing.misses) / ticks : 0;
    const missed = timing.misses ? `${count(timing.misses)} missed (${figure(part)} %)` : "none missed";
    const woke = timing.misses ? `, ${count(timing.woke_late)} of them woke too late` : "";
    write(this.#deadline, `${count(ticks)} ticks of ${figure(timing.deadline_us)} µs, ${missed}${woke}`);
    ROWS.forEach((row, i) => {
      this.#cells[i].forEach((cell, k) => {
        const us = timing[row.figures][k];
        write(cell, figure(us));
        cell.classList.toggle("over", us > timing.deadline_us);
      });
    });
    this.#draw(timing);
  }

  #draw(timing) {
    const { pen, width, height } = this.#canvas.clear();
    const edges = timing.edges_us;
    const bins = Math.max(...ROWS.map((row) => timing[row.counts].length));
    if (!bins || !edges.length) return;
    const box = { left: 34, right: width - 6, top: 16, bottom: height - 20 };
    const x = (bin) => box.left + (bin / bins) * (box.right - box.left);
    // Bins may differ in width: a time is interpolated within its bin.
    const at = (us) => {
      const bin = edges.findIndex((edge) => us <= edge);
      if (bin < 0) return bins;
      const from = bin ? edges[bin - 1] : 0;
      return bin + (us - from) / (edges[bin] - from);
    };
    const most = Math.max(1, ...ROWS.flatMap((row) => timing[row.counts]));
    const decades = Math.max(1, Math.ceil(Math.log10(most + 1)));
    const tall = (box.bottom - box.top - 20) / ROWS.length;
    ROWS.forEach((row, i) => {
      const floor = box.top + tall * (i + 1) + 20 * i;
      this.#row(pen, box, row, timing[row.counts], { x, floor, tall, decades, late: at(timing.deadline_us) });
    });
    this.#axis(pen, box, x, at, timing.deadline_us);
  }

  #row(pen, box, row, counts, { x, floor, tall, decades, late }) {
    pen.strokeStyle = colour("--grid");
    pen.fillStyle = colour("--quiet");
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    pen.lineWidth = 1;
    pen.beginPath();
    for (let decade = 0; decade <= decades; decade += decades > 4 ? 2 : 1) {
      const y = Math.round(floor - (decade / decades) * tall) + 0.5;
      pen.moveTo(box.left, y);
      pen.lineTo(box.right, y);
      pen.fillText(decade < 4 ? String(10 ** decade) : `1e${decade}`, box.left - 5, y);
    }
    pen.stroke();
    counts.forEach((n, bin) => {
      if (!n) return;
      const high = Math.max(2, (Math.log10(n + 1) / decades) * tall);
      pen.fillStyle = bin >= Math.floor(late) && bin + 1 > late ? colour("--bad") : colour(row.colour);
      pen.fillRect(x(bin) + 0.5, floor - high, Math.max(1, x(bin + 1) - x(bin) - 1), high);
    });
  }

  #axis(pen, box, x, at, deadline) {
    pen.fillStyle = colour("--quiet");
    pen.textBaseline = "top";
    let free = -Infinity;
    for (const us of [1, 3, 10, 30, 100, 300, 1000, 3000, 10000, 30000]) {
      const here = x(at(us));
      if (here - free < 34 || here >= box.right - 14) continue;
      pen.textAlign = "center";
      pen.fillText(us >= 1000 ? `${us / 1000} ms` : `${us}`, here, box.bottom + 5);
      free = here;
    }
    const line = Math.round(x(at(deadline))) + 0.5;
    pen.strokeStyle = colour("--bad");
    pen.setLineDash([4, 3]);
    pen.beginPath();
    pen.moveTo(line, box.top - 2);
    pen.lineTo(line, box.bottom);
    pen.stroke();
    pen.setLineDash([]);
    pen.fillStyle = colour("--bad");
    pen.textAlign = line > (box.left + box.right) / 2 ? "right" : "left";
    pen.fillText("deadline", pen.textAlign === "right" ? line - 4 : line + 4, 1);
  }
}
