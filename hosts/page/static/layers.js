// Places the nodes of a graph: columns by longest path, ordered for few crossings (Sugiyama, Tagawa and Toda 1981).
// A graph longer than the page is wide is folded into bands.

const GAP_X = 30;
const GAP_Y = 12;
/// Height of a wire where it passes a column.
const PASS = 12;
/// Distance of wires that run side by side.
const LANE = 6;

/** All wires of one output are one net. */
const net = ([from, output]) => `${from} ${output}`;

/**
 * `sizes` are the heights of the nodes. `wires` are [node, output, node, input]; one that runs against the order of
 * the nodes closes a cycle. Returns places and routes.
 */
export function place(sizes, wires, width, nodeWidth) {
  const columns = longestPaths(sizes.length, wires);
  const layers = [];
  columns.forEach((column, node) => ((layers[column] ??= []).push({ node, height: sizes[node], from: [] })));
  const passes = new Map();
  const routes = wires.map((wire) => route(wire, columns, layers, passes));
  order(layers);
  let each = fold(layers.length, width, nodeWidth, 0);
  let lanes = leave(layers, wires, routes, each);
  if (lanes.length) {
    each = fold(layers.length, width, nodeWidth, margin(lanes));
    lanes = leave(layers, wires, routes, each);
  }
  const side = margin(lanes);
  const room = each > 1 ? (width - 2 * side - each * nodeWidth) / (each - 1) : 0;
  const gap = Math.max(GAP_X * 0.6, Math.min(GAP_X * 2.4, room));
  return stack(layers, { each, nodeWidth, gap, side, lanes, routes });
}

const margin = (lanes) => (lanes.length ? 8 + LANE * Math.max(...lanes.map((nets) => nets.length)) : 0);

/** Columns of a band, so that all bands are about equally long. */
function fold(columns, width, nodeWidth, side) {
  const most = Math.max(1, Math.floor((width - 2 * side + GAP_X * 0.6) / (nodeWidth + GAP_X * 0.6)));
  return Math.ceil(columns / Math.ceil(columns / most));
}

function longestPaths(nodes, wires) {
  const columns = new Array(nodes).fill(0);
  // Nodes are in the order of their calls, so one pass is enough.
  for (let node = 0; node < nodes; node += 1) {
    for (const [from, , to] of wires) {
      if (to === node && from < to) columns[to] = Math.max(columns[to], columns[from] + 1);
    }
  }
  return columns;
}

/** The slots that a wire passes: one in each column between its ends, shared by its net; none if it runs back. */
function route(wire, columns, layers, passes) {
  const [from, , to] = wire;
  const back = from >= to;
  const slots = [];
  let before = layers[columns[from]].find((slot) => slot.node === from);
  for (let column = columns[from] + 1; !back && column < columns[to]; column += 1) {
    const key = `${net(wire)} ${column}`;
    if (!passes.has(key)) {
      passes.set(key, { height: PASS, from: [before] });
      layers[column].push(passes.get(key));
    }
    before = passes.get(key);
    slots.push(before);
  }
  if (!back) layers[columns[to]].find((slot) => slot.node === to).from.push(before);
  return { back, slots };
}

/** Moves each slot to the mean place of its neighbours, a few times to and fro. */
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

/** The nets that leave each band or run back, from the lowest up: in this order they do not cross. */
function leave(layers, wires, routes, each) {
  layers.forEach((layer, column) => layer.forEach((slot) => (slot.column = column)));
  const slotOf = new Map(layers.flat().filter((slot) => slot.node !== undefined).map((slot) => [slot.node, slot]));
  const lanes = Array.from({ length: Math.ceil(layers.length / each) }, () => new Map());
  wires.forEach((wire, i) => {
    const stops = [slotOf.get(wire[0]), ...routes[i].slots, slotOf.get(wire[2])];
    routes[i].stops = stops;
    routes[i].net = net(wire);
    for (let k = 1; k < stops.length; k += 1) {
      const band = Math.floor(stops[k - 1].column / each);
      if (routes[i].back || band !== Math.floor(stops[k].column / each)) {
        lanes[band].set(net(wire), stops[k - 1].at * 100 + (stops[k - 1].node === undefined ? 0 : wire[1]));
      }
    }
  });
  const sorted = lanes.map((nets) => [...nets].sort((a, b) => b[1] - a[1]).map(([name]) => name));
  return sorted.some((nets) => nets.length) ? sorted : [];
}

function stack(layers, { each, nodeWidth, gap, side, lanes, routes }) {
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
        Object.assign(slot, { x: side + column * (nodeWidth + gap), y, band: bands.length });
        if (slot.node !== undefined) places[slot.node] = slot;
        y += slot.height + GAP_Y;
      }
    });
    const nets = lanes[bands.length] ?? [];
    bands.push({ bottom: top + height, nets });
    top += height + 22 + LANE * nets.length;
  }
  const width = 2 * side + each * (nodeWidth + gap) - gap;
  return { places, bands, routes, nodeWidth, width, height: top - (bands.at(-1)?.nets.length ? 0 : 22), lane: LANE };
}
