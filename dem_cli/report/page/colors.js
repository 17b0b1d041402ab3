// Units, numbers and colours.

// As look.display_unit: [SI value of the unit, its name].
function displayUnit(units, unit, largest) {
  const choices = units[unit] || [[1, unit, 0]];
  const known = Number.isFinite(largest) && largest > 0;
  for (const [factor, name, least] of choices) {
    if (known ? largest >= least : factor === 1) return [factor, raised(name)];
  }
  const [factor, name] = choices[choices.length - 1];
  return [factor, raised(name)];
}

function raised(unit) {
  return unit === "1" ? "" : unit.replace("^2", "²").replace("^3", "³");
}

function formatNumber(value, digits = 4) {
  if (!Number.isFinite(value)) return "-";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-4) return value.toExponential(digits - 1);
  return String(Number(value.toPrecision(digits)));
}

function withUnit(units, value, unit, digits = 4) {
  if (!Number.isFinite(value)) return "-";
  const [factor, name] = displayUnit(units, unit, Math.abs(value));
  const text = formatNumber(value / factor, digits);
  return name ? `${text} ${name}` : text;
}

// Evenly spaced round numbers from low to high, about `count` of them.
function niceTicks(low, high, count, whole) {
  const least = (high - low) / count;
  if (!(least > 0)) return [low];
  const power = 10 ** Math.floor(Math.log10(least));
  let step = [1, 2, 5, 10].map((k) => k * power).find((k) => k >= least * (1 - 1e-9));
  if (whole) step = Math.max(1, Math.round(step));
  const ticks = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) ticks.push(k * step);
  return ticks;
}

function parseMap(hex) {
  return Array.from({ length: hex.length / 6 }, (_, k) => `#${hex.slice(6 * k, 6 * k + 6)}`);
}

function percentile(sorted, share) {
  if (!sorted.length) return 0;
  const at = share * (sorted.length - 1);
  const k = Math.floor(at);
  return k + 1 < sorted.length ? sorted[k] + (at - k) * (sorted[k + 1] - sorted[k]) : sorted[k];
}

// Limits of the colours for values of a kind, as sample.value_colors: long tails are cut at the 99.5th percentile.
function colorLimits(kind, values) {
  const known = Float64Array.from(values.filter((v) => Number.isFinite(v))).sort();
  if (kind === "cyclic") return [-Math.PI / 2, Math.PI / 2, false, false];
  if (!known.length) return [0, 1, false, false];
  const lowest = known[0];
  const highest = known[known.length - 1];
  let low = lowest;
  let high = highest;
  if (kind === "signed") {
    high = percentile(Float64Array.from(known, Math.abs).sort(), 0.995);
    low = -high;
  } else if (kind === "from-zero") {
    low = 0;
    high = percentile(known, 0.995);
  } else if (kind === "count") {
    low = Math.floor(low);
    high = Math.ceil(high);
  }
  if (!(high > low)) high = low + (Math.abs(low) * 1e-9 || 1);
  const tiny = 1e-9 * (high - low);
  return [low, high, lowest < low - tiny, highest > high + tiny];
}
