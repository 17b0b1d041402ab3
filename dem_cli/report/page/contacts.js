// Where the contacts of each frame start, and the end of the last.
function startsOf(counts) {
  const starts = [0];
  for (const count of counts) starts.push(starts[starts.length - 1] + count);
  return starts;
}

// Contacts of a frame: bodies (walls count from `elements`), force [N], and for those with walls the number of their foot point.
function contactsOf(data, starts, frame, elements) {
  const from = starts[frame];
  const count = starts[frame + 1] - from;
  const first = data.whole("first").subarray(from, from + count);
  const second = data.whole("second").subarray(from, from + count);
  const coded = data.whole("force").subarray(from, from + count);
  const largest = data.whole("largest")[frame];
  const mask = first instanceof Uint16Array ? 0xffff : 0xffffffff;
  const found = {
    count,
    first: new Uint32Array(count),
    second: new Uint32Array(count),
    force: new Float64Array(count),
    foot: new Int32Array(count).fill(-1),
    feet: data.whole("feet"),
  };
  let i = 0;
  let foot = footStart(data, starts, frame, elements);
  for (let c = 0; c < count; c++) {
    i = ((i + first[c]) & mask) >>> 0;
    found.first[c] = i;
    found.second[c] = ((i + second[c]) & mask) >>> 0;
    found.force[c] = largest * (coded[c] / 255) ** 2;
    if (found.second[c] >= elements) found.foot[c] = foot++;
  }
  return found;
}

// Number of the first foot point of a frame.
function footStart(data, starts, frame, elements) {
  if (!data.footStarts) {
    const first = data.whole("first");
    const second = data.whole("second");
    const mask = first instanceof Uint16Array ? 0xffff : 0xffffffff;
    data.footStarts = [0];
    for (let k = 0; k + 1 < starts.length; k++) {
      let i = 0;
      let count = 0;
      for (let c = starts[k]; c < starts[k + 1]; c++) {
        i = ((i + first[c]) & mask) >>> 0;
        if (((i + second[c]) & mask) >>> 0 >= elements) count++;
      }
      data.footStarts.push(data.footStarts[k] + count);
    }
  }
  return data.footStarts[frame];
}
