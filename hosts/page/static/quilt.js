// A picture of a material, laid on a surface at true scale and as far as it reaches. A picture is smaller than a surface:
// patches of it are put side by side where their edges agree (image quilting: Efros and Freeman, SIGGRAPH 2001).

/// Part of the picture in a patch, part of a patch that overlaps the one before, and places tried for each.
const [PATCH, OVERLAP, TRIES] = [0.5, 0.25, 40];
/// Patches of a quilt, across and down. Then it repeats.
const PATCHES = [16, 16];
/// Part of the picture at each edge that is left out: the lens darkens it.
const RIM = 0.08;
/// Part of the colour that is kept: the picture is a ground to draw on.
const COLOUR = 0.72;
/// Contrast that a picture is brought to, and by how much at most.
const [CONTRAST, STRONGER] = [20, 3];

/** Fills a canvas with a picture that is `mm` wide; a millimetre has `scale` screen pixels. */
export function lay(pen, width, height, image, mm, scale) {
  const size = [mm * scale, (mm * scale * image.naturalHeight) / image.naturalWidth].map((x) => Math.max(8, Math.round(x)));
  const patch = size.map((x) => Math.max(4, Math.round(x * PATCH)));
  const over = patch.map((x) => Math.max(1, Math.round(x * OVERLAP)));
  const quilt = sew(evened(image, size), size, patch, over);
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [quilt.width - over[0], quilt.height - over[1]];
  // What hangs over at the right and below is the beginning of the next one: it fades into it.
  const hem = ([x, y], [dx, dy], wide, high) => {
    for (let j = 0; j < high; j += 1) {
      for (let i = 0; i < wide; i += 1) {
        const part = dx ? i / over[0] : j / over[1];
        const a = 4 * ((y + j) * quilt.width + x + i);
        const b = 4 * ((y + j + dy) * quilt.width + x + i + dx);
        for (let c = 0; c < 3; c += 1) quilt.data[a + c] += (1 - part) * (quilt.data[b + c] - quilt.data[a + c]);
      }
    }
  };
  hem([0, 0], [canvas.width, 0], over[0], quilt.height);
  hem([0, 0], [0, canvas.height], quilt.width, over[1]);
  canvas.getContext("2d").putImageData(quilt, 0, 0);
  pen.save();
  pen.setTransform(1, 0, 0, 1, 0, 0);
  pen.fillStyle = pen.createPattern(canvas, "repeat");
  pen.fillRect(0, 0, width, height);
  pen.restore();
}

/** A quilt of patches: each is the one of some that fits best to what lies there. */
function sew(from, size, patch, over) {
  const step = patch.map((x, k) => x - over[k]);
  const into = new ImageData(step[0] * PATCHES[0] + over[0], step[1] * PATCHES[1] + over[1]);
  const rim = size.map((x) => Math.floor(x * RIM));
  let seed = 1;
  const random = (below) => {
    seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
    return Math.floor((seed / 2 ** 32) * below);
  };
  for (let y = 0; y < into.height - over[1]; y += step[1]) {
    for (let x = 0; x < into.width - over[0]; x += step[0]) {
      let best = { off: Infinity };
      for (let i = 0; i < (x || y ? TRIES : 1); i += 1) {
        const at = size.map((all, k) => rim[k] + random(all - patch[k] - 2 * rim[k] + 1));
        const off = mismatch(from, at, into, [x, y], patch, over, best.off);
        if (off < best.off) best = { at, off };
      }
      paste(from, best.at, into, [x, y], patch, over);
    }
  }
  return into;
}

/** The picture in another size, without the lights that darken its corners, and paler. */
function evened(image, [width, height]) {
  const draw = (w, h) => {
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [w, h];
    return canvas;
  };
  const [sharp, small, blurred] = [draw(width, height), draw(8, 6), draw(width, height)];
  const pen = (canvas) => Object.assign(canvas.getContext("2d", { willReadFrequently: true }), { imageSmoothingQuality: "high" });
  pen(sharp).drawImage(image, 0, 0, width, height);
  pen(small).drawImage(image, 0, 0, 8, 6);
  pen(blurred).drawImage(small, 0, 0, width, height);
  const data = pen(sharp).getImageData(0, 0, width, height);
  const low = pen(blurred).getImageData(0, 0, width, height).data;
  const mean = [0, 1, 2].map((c) => low.reduce((sum, x, i) => sum + (i % 4 === c ? x : 0), 0) / (width * height));
  const grey = (mean[0] + mean[1] + mean[2]) / 3;
  const power = data.data.reduce((sum, x, i) => sum + (i % 4 < 3 ? (x - low[i]) ** 2 : 0), 0) / (3 * width * height);
  const gain = Math.min(STRONGER, Math.max(1, CONTRAST / Math.sqrt(power)));
  for (let i = 0; i < data.data.length; i += 4) {
    const even = [0, 1, 2].map((c) => gain * (data.data[i + c] - low[i + c]));
    const own = (even[0] + even[1] + even[2]) / 3;
    for (let c = 0; c < 3; c += 1) data.data[i + c] = grey + own + COLOUR * (even[c] - own) + 0.5 * (mean[c] - grey);
  }
  return data;
}

/** How badly a patch fits what lies there, over its upper and left overlap. Gives up beyond `most`. */
function mismatch(from, [sx, sy], into, [x, y], [pw, ph], [ow, oh], most) {
  let sum = 0;
  // Few pixels tell enough.
  const step = Math.max(1, Math.round(ow / 5));
  for (let j = 0; j < ph; j += step) {
    const wide = y && j < oh ? pw : x ? ow : 0;
    for (let i = 0; i < wide; i += step) {
      const a = 4 * ((sy + j) * from.width + sx + i);
      const b = 4 * ((y + j) * into.width + x + i);
      for (let c = 0; c < 3; c += 1) sum += (from.data[a + c] - into.data[b + c]) ** 2;
    }
    if (sum > most) return sum;
  }
  return sum;
}

/** Lays a patch; over its overlap it fades in. */
function paste(from, [sx, sy], into, [x, y], [pw, ph], [ow, oh]) {
  for (let j = 0; j < ph; j += 1) {
    for (let i = 0; i < pw; i += 1) {
      const part = Math.min(x ? (i + 1) / (ow + 1) : 1, y ? (j + 1) / (oh + 1) : 1, 1);
      const a = 4 * ((sy + j) * from.width + sx + i);
      const b = 4 * ((y + j) * into.width + x + i);
      for (let c = 0; c < 3; c += 1) into.data[b + c] += part * (from.data[a + c] - into.data[b + c]);
      into.data[b + 3] = 255;
    }
  }
}
