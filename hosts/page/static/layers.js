// Places the nodes of a graph: in columns by the longest path to them, in an order that crosses few wires, and folded
// into bands where the page is narrower than the graph is long (Sugiyama, Tagawa and Toda 1981, with bands).

const GAP_X = 34;
const GAP_Y = 12;
const BAND = 34;
/// Height that a wire takes where it passes a column.
const PASS = 14;

/**
 * `sizes` are heights of the nodes; `wires` are [node, output, node, input], where a wire that runs against the order of
 * the nodes closes a cycle. Answers places, and for each wire the points it goes through with the columns between.
 */
export function place(sizes, wires, width, nodeWidth) {
  const columns = longestPaths(sizes.length, wires);
  const layers = [];
  columns.forEach((column, node) => ((layers[column] ??= []).push({ node, height: sizes[node], from: [] })));
  const routes = wires.map((wire) => route(wire, columns, layers));
  order(layers);
  const perBand = Math.max(1, Math.min(layers.length, Math.floor((width + GAP_X) / (nodeWidth + GAP_X))));
  // Bands of about the same length look better than a last one of a single column.
  const bands = Math.ceil(layers.length / perBand);
  const each = Math.ceil(layers.length / bands);
  const wide = Math.min(GAP_X * 2.2, each > 1 ? (width - each * nodeWidth) / (each - 1) : GAP_X);
  return { ...stack(layers, each, nodeWidth, Math.max(GAP_X * 0.7, wide)), routes, columns, each };
}

function longestPaths(nodes, wires) {
  const columns = new Array(nodes).fill(0);
  // Nodes are in the order they run, so one pass settles all that does not run against it.
  for (let node = 0; node < nodes; node += 1) {
    for (const [from, , to] of wires) {
      if (to === node && from < to) columns[to] = Math.max(columns[to], columns[from] + 1);
    }
  }
  return columns;
}

/** The slots that a wire passes, one in each column between its ends; none for one that runs back. */
function route([from, , to], columns, layers) {
  const back = from >= to;
  const slots = [];
  let before = layers[columns[from]].find((slot) => slot.node === from);
  for (let column = columns[from] + 1; !back && column < columns[to]; column += 1) {
    const slot = { height: PASS, from: [before] };
    layers[column].push(slot);
    slots.push({ slot, column });
    before = slot;
  }
  if (!back) layers[columns[to]].find((slot) => slot.node === to).from.push(before);
  return { back, slots };
}

/** Each slot goes to the mean place of what it hears and what hears it, a few times to and fro. */
function order(layers) {
  const number = (layer) => layer.forEach((slot, i) => (slot.at = i + (1 - layer.length) / 2));
  layers.forEach(number);
  const mean = (slots, slot) => (slots.length ? slots.reduce((sum, x) => sum + x.at, 0) / slots.length : slot.at);
  for (let pass = 0; pass < 6; pass += 1) {
    const forth = pass % 2 === 0;
    for (const layer of forth ? layers : [...layers].reverse()) {
      const to = new Map(layer.map((slot) => [slot, []]));
      if (!forth) layers.flat().forEach((next) => next.from.forEach((slot) => to.get(slot)?.push(next)));
      for (const slot of layer) slot.wish = mean(forth ? slot.from : to.get(slot), slot);
      layer.sort((a, b) => a.wish - b.wish);
      number(layer);
    }
  }
}

function stack(layers, each, nodeWidth, gap) {
  const places = [];
  const bands = [];
  let top = 0;
  for (let first = 0; first < layers.length; first += each) {
    const band = layers.slice(first, first + each);
    const tall = band.map((layer) => layer.reduce((sum, slot) => sum + slot.height + GAP_Y, -GAP_Y));
    const height = Math.max(...tall);
    band.forEach((layer, column) => {
      let y = top + (height - tall[column]) / 2;
      for (const slot of layer) {
        Object.assign(slot, { x: column * (nodeWidth + gap), y, band: bands.length });
        if (slot.node !== undefined) places[slot.node] = slot;
        y += slot.height + GAP_Y;
      }
    });
    bands.push({ top, bottom: top + height });
    top += height + BAND;
  }
  const width = each * (nodeWidth + gap) - gap;
  return { places, bands, gap, nodeWidth, width, height: top - BAND, gutter: BAND };
}
