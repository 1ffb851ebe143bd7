// A picture of a material, tiled at true scale. Every second tile is mirrored, so that edges meet themselves.

/** Fills a canvas with a picture that is `mm` wide, its middle in the middle; a millimetre has `scale` screen pixels. */
export function tile(pen, width, height, image, mm, scale) {
  const [w, h] = [mm * scale, (mm * scale * image.naturalHeight) / image.naturalWidth].map((x) => Math.max(2, Math.round(x)));
  const four = document.createElement("canvas");
  [four.width, four.height] = [2 * w, 2 * h];
  const part = four.getContext("2d");
  part.imageSmoothingQuality = "high";
  for (const [x, y] of [[0, 0], [1, 0], [0, 1], [1, 1]]) {
    part.setTransform(x ? -1 : 1, 0, 0, y ? -1 : 1, 2 * w * x, 2 * h * y);
    part.drawImage(image, 0, 0, w, h);
  }
  pen.save();
  pen.setTransform(1, 0, 0, 1, Math.round(width / 2 - w / 2), Math.round(height / 2 - h / 2));
  pen.fillStyle = pen.createPattern(four, "repeat");
  pen.fillRect(-width, -height, 3 * width, 3 * height);
  pen.restore();
}
