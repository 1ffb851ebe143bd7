// A WAV file of one channel of 32-bit floats.

/** `chunks` are Float32Arrays, one after the other. */
export function wav(chunks, rate) {
  const count = chunks.reduce((sum, chunk) => sum + chunk.length, 0);
  const head = new DataView(new ArrayBuffer(58));
  const text = (at, word) => [...word].forEach((letter, i) => head.setUint8(at + i, letter.charCodeAt(0)));
  text(0, "RIFF");
  head.setUint32(4, 50 + 4 * count, true);
  text(8, "WAVEfmt ");
  head.setUint32(16, 18, true);
  head.setUint16(20, 3, true); // floats
  head.setUint16(22, 1, true);
  head.setUint32(24, rate, true);
  head.setUint32(28, 4 * rate, true);
  head.setUint16(32, 4, true);
  head.setUint16(34, 32, true);
  text(38, "fact");
  head.setUint32(42, 4, true);
  head.setUint32(46, count, true);
  text(50, "data");
  head.setUint32(54, 4 * count, true);
  return new Blob([head, ...chunks], { type: "audio/wav" });
}
