// From the form to the arguments of `mimu import`.

import { $, made } from "./elements.js";

const ROLES = [
  ["-", "not used"],
  ["t_s", "time"],
  ["sample", "sample number"],
  ...["gyro", "accel"].flatMap((sensor) => ["x", "y", "z"].map((axis) => [`${sensor}_${axis}`, `${sensor} ${axis}`])),
  ["temp_c", "temperature, °C"],
  ["step", "step (number of the pose)"],
  ...["x", "y", "z"].map((axis) => [`ref_rate_${axis}_dps`, `known rate ${axis}, deg/s`]),
  ...["x", "y", "z"].map((axis) => [`ref_force_${axis}_mps2`, `known specific force ${axis}, m/s²`]),
];

/** Factors to SI; for other units the fit finds the factor. */
const TO_SI = {
  accel: { "m/s²": 1, g: 9.80665, mg: 0.00980665 },
  gyro: { "rad/s": 1, "deg/s": Math.PI / 180, "mdeg/s": Math.PI / 180000 },
};

/** Factors of a magnetometer to µT. */
const TO_MICROTESLA = { "µT": 1, nT: 1e-3, mG: 0.1, mT: 1e3, gauss: 100, T: 1e6 };

/** Triad of a column and its kind: `["gyro2", "gyro"]` of `gyro2_x`. */
const triadOf = (role) => /^((gyro|accel|mag)\d*)_x$/.exec(role)?.slice(1);

/** Field that sets an argument of the command. */
export const FIELD_OF = {
  "--columns": "files", "--rate-hz": "rate", "--time-unit": "time-unit", "--gravity": "gravity", "--latitude": "latitude", "--topic": "topic",
  "--raw-unit": "accel-unit", "--reference": "reference", "--skip-broken": "broken", "--instance": "instance", "--device": "unit-name", "--where": "more-import",
  "--scale": "more-import", "--offset": "more-import", "--signed-low-byte": "more-import", "--trust-readings": "more-import", "--preset": "more-import", "--still": "more-fit",
  "--steps": "more-fit", "--only": "more-fit", "--keep": "more-fit",
};

/** Shows the columns of `looked`, the answer of `columns`, each with its guessed role, and `units`, from which the log may be. */
export function show(looked, units) {
  const known = new Set(ROLES.map(([value]) => value));
  const further = new Set(looked.files.flatMap((file) => file.roles ?? []).filter((role) => !known.has(role)));
  const all = [...ROLES, ...[...further].map((role) => [role, role.replace("_", " ")])];
  const lists = looked.files.map((file, k) => {
    const columns = file.roles.map((role, at) => {
      const name = file.names[at] ?? `column ${at + 1}`;
      const select = made("select", { id: `role-${k}-${at}` }, ...all.map(([value, text]) => made("option", { value, textContent: text })));
      select.value = role;
      const cells = made("span", { className: "cells", textContent: file.rows.map((row) => row[at] ?? "").join("  ") });
      const label = made("label", {}, made("span", { className: "label", textContent: name }), cells, select);
      const item = made("li", { className: "column" }, label);
      const mark = () => item.classList.toggle("unused", select.value === "-");
      select.addEventListener("change", () => (mark(), follow()));
      mark();
      return item;
    });
    const legend = made("legend", { textContent: file.file });
    const content = file.log
      ? made("p", { textContent: "A log says itself what it holds. Its own calibration is undone, and what could not be undone is a warning." })
      : made("ul", { className: "column-list" }, ...columns);
    return made("fieldset", { className: "file" }, legend, content);
  });
  $("files").replaceChildren(...lists);
  const { preset, files } = looked;
  const guessed = files.some((file) => file.by_readings);
  $("taken").textContent = files.every((file) => file.log)
    ? ""
    : preset
      ? `Recognised by its header: ${preset.title}.`
      : guessed
        ? "The file has no names of columns, so they were guessed from the readings. Check them."
        : "By the names in the file. Correct what is wrong.";
  const say = (id, value) => ($(id).value = value);
  const of = (key) => files.map((file) => file[key]).find(Boolean);
  for (const [sensor, si] of [["accel", "m/s²"], ["gyro", "rad/s"]]) {
    say(`${sensor}-unit`, preset?.raw_unit === "SI" ? si : (preset?.raw_unit ?? looked.units[sensor]?.unit ?? ""));
    $(`${sensor}-unit`).onchange = follow;
  }
  say("time-unit", preset ? "" : (of("time_unit") ?? ""));
  $("unit").replaceChildren(...units.map(({ name, from }, value) => made("option", { value, textContent: value ? `${name} again, as ${from}` : `a new unit, ${name}` })));
  $("unit-field").hidden = units.length < 2;
  follow();

  function follow() {
    const roles = chosen();
    const has = (start) => roles.flat().some((role) => role.startsWith(start));
    const log = files.some((file) => file.log);
    $("accel-unit-field").hidden = log || !has("accel_");
    $("gyro-unit-field").hidden = log || !has("gyro_");
    for (const sensor of ["accel", "gyro"]) $(`${sensor}-unit`).required = !$(`${sensor}-unit-field`).hidden;
    $("units-by").textContent = log || preset?.raw_unit ? "" : unitsBy(looked.units, has);
    $("time-unit-field").hidden = log || !has("t_s");
    $("rate-field").hidden = log;
    const timeless = !log && !has("t_s");
    $("rate").required = timeless;
    $("rate").placeholder = timeless ? "needed: no column is the time" : "from the time stamps";
    $("topic-field").hidden = $("instance-field").hidden = !log;
    $("several-field").hidden = files.length < 2;
    if (has("ref_")) say("reference", "table");
  }
}

/** Why the units are what they are, and what is open. */
function unitsBy(units, has) {
  const present = [["Accelerometer", "accel"], ["Gyro", "gyro"]].filter(([, sensor]) => has(`${sensor}_`));
  const lines = present.filter(([, sensor]) => units[sensor]).map(([name, sensor]) => {
    const { unit, reason } = units[sensor];
    return `${name}: ${reason}${unit ? "" : "; choose the unit"}.`;
  });
  const si = present.map(([, sensor]) => $(`${sensor}-unit`).value in TO_SI[sensor]);
  if (si.includes(true) && si.includes(false)) lines.push("A recording has one unit for both sensors: if only one of them is in SI, both are imported as counts.");
  return lines.join(" ");
}

/** Role of each column of each file. */
function chosen() {
  return [...document.querySelectorAll("#files .file")].map((file) => [...file.querySelectorAll("select")].map((select) => select.value));
}

/** Splits at blanks, as a shell does; quotes keep blanks. */
export function cut(text) {
  return [...text.matchAll(/"([^"]*)"|'([^']*)'|(\S+)/g)].map((m) => m[1] ?? m[2] ?? m[3]);
}

/** How several files belong together: joined, one pose each, or separate recordings. */
export const several = (looked) => (looked.files.length > 1 ? $("several").value : "");

/** The arguments of `mimu import` without its output, for each recording of the unit `device` that the files of `looked` make. */
export function imports(looked, names, device) {
  const roles = chosen();
  const alone = ["joint", "verify"].includes(several(looked));
  if (!alone) return [importArguments(looked, names, roles, device)];
  return names.map((name, k) => importArguments({ ...looked, files: [looked.files[k]] }, [name], [roles[k]], device, alone));
}

/** The arguments for these files. `alone`: a single one of several files, whose preset may belong to all of them together. */
function importArguments(looked, names, roles, device, alone = false) {
  const args = ["import", ...names];
  const add = (flag, value) => value && args.push(flag, value);
  const log = looked.files.some((file) => file.log);
  if (!log) {
    const { preset } = looked;
    const as = preset && !alone && roles.every((list, k) => list.every((role, at) => role === looked.files[k].roles[at]));
    if (as) args.push("--preset", preset.name);
    else roles.forEach((list) => args.push("--columns", list.join(",")));
    if (preset && !as) preset.scales.forEach((scale) => args.push("--scale", scale));
    const present = ["accel", "gyro"].filter((sensor) => roles.flat().some((role) => role.startsWith(sensor)));
    const units = present.map((sensor) => $(`${sensor}-unit`).value);
    const si = present.every((sensor, k) => units[k] in TO_SI[sensor]);
    if (si) {
      const triads = roles.flat().map(triadOf).filter(Boolean);
      const mag = looked.files.map((file) => TO_MICROTESLA[file.mag_unit]).find(Boolean);
      // The factors of a preset are complete.
      for (const [triad, kind] of preset ? [] : triads.filter(([triad]) => !["gyro", "accel"].includes(triad))) {
        const factor = kind === "mag" ? mag : TO_SI[kind][units[present.indexOf(kind)]];
        if ((factor ?? 1) !== 1) args.push("--scale", `${triad}=${factor}`);
      }
      present.forEach((sensor, k) => TO_SI[sensor][units[k]] !== 1 && args.push("--scale", `${sensor}=${TO_SI[sensor][units[k]]}`));
      args.push("--raw-unit", "SI");
    } else args.push("--raw-unit", units.every((unit) => unit === "V") ? "V" : "count");
    add("--separator", looked.files.map((file) => file.separator).find(Boolean));
    add("--time-unit", $("time-unit").value);
    add("--rate-hz", $("rate").value.trim().replace(",", "."));
  } else {
    $("topic").value.split(/[\s,]+/).forEach((topic) => add("--topic", topic));
    add("--instance", $("instance").value);
  }
  add("--gravity", $("gravity").value.trim().replace(",", "."));
  add("--latitude", $("latitude").value.trim().replace(",", "."));
  args.push("--reference", $("reference").value);
  if (several(looked)) args.push(`--${several(looked)}`);
  if ($("broken").value) args.push(`--skip-broken=${$("broken").value}`);
  return [...args, "--device", device, ...cut($("more-import").value), "--replace", "--json", "import.json"];
}
