// The page: from dropped files to a calibration, one step after the other.

import { loadJournal, offerBoards } from "./board.js";
import { $, made } from "./elements.js";
import { FORMATS } from "./exports.js";
import { FIELD_OF, cut, imports, several, show } from "./fields.js";
import { Cancelled, Program, Refused, load } from "./program.js";
import { sphere } from "./sphere.js";

/**
 * A calibration of the person, `given`; the files that were dropped last and what was found in them, or a later session with a board; the units with results, those of them that were
 * `offered` for these files beside a new one, `dropped`; and the `unit` at work.
 */
const state = { given: null, files: [], looked: null, session: null, recordings: ["rec"], program: null, units: [], offered: [], dropped: null, unit: null, example: false };

/** A unit without results. `calibration` and `noise` become { text, rawUnit, from }: a file, the unit of the readings that it is for, and the name of their log. */
const newUnit = (name) => ({ name, calibration: null, noise: null });

/** The results that `unit` has, by the names of their files. */
const resultsOf = (unit) => ["calibration", "noise"].filter((of) => unit[of]).map((of) => [`${of}.toml`, unit[of]]);

/** Text in which each argument of the command links to the field that sets it. */
function withFields(text, fields = FIELD_OF) {
  return text.split(/(--[a-z-]+)/).map((part) => {
    const id = fields[part];
    if (!id) return part;
    const button = made("button", { type: "button", className: "field-link", textContent: part });
    button.addEventListener("click", () => {
      const target = id === "files" ? $("files").querySelector("select") : $(id);
      target?.closest("details")?.setAttribute("open", "");
      if (target && !target.matches("input, select, button")) target.querySelector("select, input")?.focus();
      else (target ?? $("columns-title")).focus();
    });
    return button;
  });
}

/** Shows the line of a refusal below `place`, where the person is looking; an empty line removes it. */
function refuse(line, place = $("drop").parentElement, fields = FIELD_OF) {
  place.after($("error"));
  $("error").replaceChildren(...withFields(line, fields));
  $("error").hidden = !line;
  if (line) $("error").focus();
}

function status(text, share) {
  $("status").textContent = text;
  if (share === undefined) $("bar").removeAttribute("value");
  else $("bar").value = share;
}

/** The program, with the dropped files in its folder, or those of the session. */
async function program() {
  state.program ??= new Program(({ what, share }) => status(`${what}: ${Math.round(100 * share)} %`, share));
  await state.program.files(state.files);
  if (state.session) await state.program.ask("unpack", { name: "session", files: state.session.files });
  return state.program;
}

/** Names of the files in the folder: all different, and none that looks like an argument. */
function named(files) {
  const taken = new Set();
  return [...files].map((file) => {
    let name = file.name.replace(/^-+/, "").replace(/[/\\]/g, "_") || "log";
    while (taken.has(name)) name = `another-${name}`;
    taken.add(name);
    return { name, file };
  });
}

/** Does `work`. If it fails, its line is shown, and the page continues. */
async function guarded(work, place, fields) {
  refuse("", place, fields);
  try {
    await work();
  } catch (error) {
    if (error instanceof Cancelled) return;
    refuse(error instanceof Refused ? error.message : `this page has a fault (${error?.message ?? error}); load it again, and report it if it comes back`, place, fields);
    if (!(error instanceof Refused)) console.error(error);
  }
}

async function open(files) {
  if (files.length === 0) return;
  if (files.length === 1 && /\.zip$/i.test(files[0].name)) return loadJournal(files[0]);
  files = await withoutCalibration([...files]);
  if (files.length === 0) return;
  cancel();
  Object.assign(state, { files: named(files), session: null, recordings: ["rec"] });
  // The gravity of the example does not apply to other files, nor the rate and the sensor of one log to another.
  if (state.example) $("gravity").value = "";
  for (const id of ["rate", "topic", "instance"]) $(id).value = "";
  state.example = false;
  $("result").hidden = $("work").hidden = true;
  await guarded(async () => {
    $("columns").hidden = true;
    const mimu = await program();
    const done = await mimu.run("columns", ...state.files.map(({ name }) => name));
    state.looked = JSON.parse(done.stdout);
    Object.assign(state, { dropped: newUnit(state.files[0].name.replace(/\.[^.]*$/, "")), offered: [...state.units] });
    $("unit-name").value = "";
    $("unit-name").placeholder = state.dropped.name;
    $("verify-given").hidden = $("apply-given").hidden = !state.given;
    const known = state.offered.map((unit) => ({ name: unit.name, from: resultsOf(unit).at(-1)[1].from }));
    show(state.looked, [state.dropped, ...known]);
    $("columns").hidden = false;
    $("columns-title").focus();
  });
}

/** Keeps a calibration that is among the dropped `files`, and returns the others. */
async function withoutCalibration(files) {
  for (const file of files.filter(({ name }) => /\.toml$/i.test(name))) {
    const text = await file.text();
    if (!/^format = "mimu-calibration\//m.test(text)) {
      refuse(`${file.name}: this is no calibration; drop a file of mimu fit, or a log`);
      return [];
    }
    state.given = { name: file.name, text };
    $("given").textContent = `${file.name}: drop a log to verify it by, or to apply it to.`;
    $("given").hidden = false;
    $("verify-given").hidden = $("apply-given").hidden = $("columns").hidden;
  }
  return files.filter(({ name }) => !/\.toml$/i.test(name));
}

/** Ends what is being computed. */
function cancel() {
  state.program?.end();
  state.program = null;
}

/** A step of the work, as a line in the list with its time and the memory that it took. */
async function step(title, work) {
  const line = made("li", { textContent: title });
  $("steps").append(line);
  status(`${title} …`);
  const begun = performance.now();
  try {
    const result = await work();
    line.className = "done";
    line.append(`: ${((performance.now() - begun) / 1000).toFixed(1)} s, ${Math.ceil(result.memory / 1e6)} MB`);
    return result;
  } catch (error) {
    line.className = "refused";
    line.append(error instanceof Cancelled ? ": cancelled" : ": refused");
    throw error;
  }
}

/** Clears what was shown, and does `steps`. */
async function compute(steps) {
  $("result").hidden = true;
  $("work").hidden = $("progress").hidden = false;
  $("work-title").focus();
  for (const id of ["steps", "errors", "warnings", "allan", "trace", "sphere", "kept", "next", "exported", "verdict", "judgement", "parameters"]) $(id).replaceChildren();
  $("report-part").open = false;
  for (const id of ["report-part", "away", "pictures", "verdict", "judgement"]) $(id).hidden = true;
  await guarded(async () => {
    try {
      await steps(await program());
    } finally {
      $("progress").hidden = true;
      status("");
    }
  }, $("work"));
}

/** Imports the dropped files as the form says. */
async function imported(mimu) {
  const names = state.files.map(({ name }) => name);
  const again = Number($("unit").value);
  state.unit = again ? state.offered[again - 1] : state.dropped;
  if (!again && $("unit-name").value.trim()) state.unit.name = $("unit-name").value.trim();
  const all = imports(state.looked, names, state.unit.name);
  state.recordings = all.map((_, k) => (k ? `rec-${k + 1}` : "rec"));
  for (const [k, args] of all.entries()) {
    await step(all.length > 1 ? `Import of ${names[k]}` : "Import", () => mimu.run(...args, "-o", state.recordings[k]));
    warn((await mimu.json("import.json")).warnings);
  }
}

async function calibrate(mimu) {
  await imported(mimu);
  // A diagnosis is verified by one recording; the report judges the calibration by all of them.
  const [, ...others] = state.recordings;
  const verify = several(state.looked) === "verify" ? others.flatMap((rec) => ["--verify", rec]) : [];
  await fitted(mimu, state.files[0].name, cut($("more-fit").value), verify, verify.length ? [] : others);
}

/**
 * Fits the first recording and diagnoses it. `verify`: arguments with later recordings of the unit; `others`: recordings in which effects are
 * searched too; `name`: the name of the recording.
 */
async function fitted(mimu, name, more, verify = [], others = []) {
  const [rec] = state.recordings;
  // The readings are shown even if they cannot be fitted, because they show why.
  const fit = await step("Calibration", () => mimu.run("fit", rec, "-o", "cal.toml", "--replace", "--json", "fit.json", ...more)).catch(refusal);
  const shown = fit instanceof Refused ? [] : ["cal.toml"];
  const view = await step("Readings and poses", () => mimu.run("view", rec, ...shown)).catch((why) => {
    throw fit instanceof Refused ? fit : why;
  });
  picture(JSON.parse(view.stdout));
  $("result").hidden = false;
  if (fit instanceof Refused) throw fit;
  keepResult("calibration", await mimu.text("cal.toml"), await rawUnit(mimu), name);
  const fitted = await mimu.json("fit.json");
  judge(fitted);
  warn(fitted.warnings);
  $("errors").replaceChildren(printed("mimu fit", fit));
  const shared = more.filter((_, k) => more[k] !== "--only" && more[k - 1] !== "--only");
  const page = ["-o", "calibration.toml", "--replace", "--json", "diagnosis.json", "--page", "diagnosis.html"];
  const found = await step("Diagnosis", () => mimu.run("diagnose", rec, ...others, ...page, ...shared, ...verify.slice(0, 2))).catch(refusal);
  if (!(found instanceof Refused)) {
    state.unit.calibration.text = await mimu.text("calibration.toml");
    const diagnosed = await mimu.json("diagnosis.json");
    judge(diagnosed);
    warn(diagnosed.warnings);
    verdict(await mimu.text("diagnosis.html"));
    const given = ["--calibration", "calibration.toml", ...verify, ...optionsOf(more, OF_REPORT)];
    await step("Report", () => mimu.run("report", rec, ...others, ...given, "-o", "report.html"));
    await report(await mimu.text("report.html"));
  }
  await keep(mimu, ["fit.json", "diagnosis.json", "diagnosis.html", "report.html"]);
  if (found instanceof Refused) throw found;
}

/** Calibrates from the recordings of a session with the board called `name`. `more`: further arguments. */
async function finished(files, name, more) {
  cancel();
  Object.assign(state, { files: [], session: { files }, recordings: ["session/calibration"], unit: newUnit(name) });
  $("columns").hidden = true;
  const verify = files.has("verification/samples.csv") ? ["--verify", "session/verification"] : [];
  await compute((mimu) => fitted(mimu, `the session with ${name}`, more, verify));
}

/** Judges the calibration of the person by the dropped log. */
async function verifyGiven(mimu) {
  await imported(mimu);
  await mimu.write("given.toml", state.given.text);
  const done = await step("Verification", () => mimu.run("verify", state.recordings[0], "--calibration", "given.toml", "--json", "verify.json", ...cut($("more-fit").value)));
  const found = await mimu.json("verify.json");
  judge(found);
  warn(found.warnings);
  $("errors").replaceChildren(made("pre", { textContent: done.stdout }));
  $("result").hidden = false;
  await keep(mimu, ["verify.json"]);
}

/** Applies the calibration of the person to the dropped log. */
async function applyGiven(mimu) {
  await imported(mimu);
  await mimu.write("given.toml", state.given.text);
  const args = [state.recordings[0], "--calibration", "given.toml", "--format", "csv", "--replace", "-o", "calibrated"];
  const done = await step("Application", () => mimu.run("apply", ...args));
  $("errors").replaceChildren(made("pre", { textContent: done.stdout }));
  $("result").hidden = false;
  await keep(mimu, ["calibrated/samples.csv"]);
}

async function noise(mimu) {
  await imported(mimu);
  const before = state.unit.calibration;
  const unit = await rawUnit(mimu);
  const fits = before?.rawUnit === unit;
  if (before && !fits) warn([`The calibration of ${state.unit.name} is for readings in ${before.rawUnit}, and this log is in ${unit}: the noise is computed without it.`]);
  const by = fits ? ["--calibration", "before.toml"] : [];
  if (fits) await mimu.write("before.toml", before.text);
  const files = ["-o", "noise.toml", "--json", "allan.json", "--plot", "allan.svg"];
  const done = await step("Allan deviation", () => mimu.run("allan", "rec", ...files, ...by));
  if (state.recordings.length > 1) warn([`The noise is that of ${state.files[0].name} alone.`]);
  keepResult("noise", await mimu.text("noise.toml"), unit, state.files[0].name);
  const found = await mimu.json("allan.json");
  judge(found);
  warn(found.warnings);
  const plot = new DOMParser().parseFromString(await mimu.text("allan.svg"), "image/svg+xml").documentElement;
  $("allan").replaceChildren(document.importNode(plot, true), printed("mimu allan", done));
  $("result").hidden = false;
  await keep(mimu, ["allan.json", "allan.svg"]);
}

/** What the command prints, folded. */
function printed(command, done) {
  const text = made("div", { className: "scroll", tabIndex: 0 }, made("pre", { textContent: done.stdout }));
  return made("details", {}, made("summary", { textContent: `What ${command} prints` }), text);
}

/** Options of `mimu fit` that `mimu report` has as well. */
const OF_REPORT = ["--still", "--steps", "--keep"];

/** The arguments in `more` that are among `options`, with their values. */
function optionsOf(more, options) {
  return more.filter((argument, k) => options.includes(argument.split("=")[0]) || (options.includes(more[k - 1]) && !argument.startsWith("-")));
}

/** Returns a refusal as a result; throws any other error. */
function refusal(error) {
  if (error instanceof Refused) return error;
  throw error;
}

function warn(warnings) {
  const known = new Set([...$("warnings").children].map((line) => line.textContent));
  for (const warning of warnings ?? []) {
    const text = typeof warning === "string" ? warning : warning.text ?? JSON.stringify(warning);
    if (!known.has(text)) $("warnings").append(made("li", {}, ...withFields(text)));
  }
}

function picture(view) {
  $("pictures").hidden = false;
  // The program's own drawing, which escapes its inputs.
  $("trace").innerHTML = view.trace;
  $("poses-part").hidden = view.poses.length === 0;
  if (view.poses.length === 0) return;
  $("sphere").replaceChildren(sphere(view));
  const gain = view.next && Math.round(100 * view.next.gain);
  const most = view.next
    ? `Shaded: how much one more dwell with that direction up would add. Most: ${view.next.words}, which would lower the sigmas of the accelerometer's parameters by ${gain < 1 ? "less than 1" : gain} % in the mean.`
    : "These poses do not determine all parameters of the accelerometer, so that no single one can be said to add most.";
  $("next").textContent = `${view.poses.length} poses: the direction that is up, in the body frame. Equal areas. ${most}`;
}

/** Shows the judgement of a result, before anything else of it. */
function judge({ judgement: { kind, reason } }) {
  $("judgement").className = `judged ${kind}`;
  $("judgement").replaceChildren(made("strong", { textContent: kind }), `: ${reason}.`);
  $("judgement").hidden = false;
}

/** Shows the verdict and the errors of a diagnosis. */
function verdict(html) {
  const parsed = new DOMParser().parseFromString(html, "text/html");
  const found = parsed.querySelector(".verdict");
  $("verdict").className = found.className;
  $("verdict").replaceChildren(...document.importNode(found, true).childNodes);
  $("verdict").hidden = false;
  const errors = parsed.querySelector("table");
  if (errors) $("errors").prepend(document.importNode(errors, true));
}

/** Shows the report of the unit, folded, and its table of the calibration on the page itself. */
async function report(html) {
  const parsed = new DOMParser().parseFromString(html, "text/html");
  const tables = [];
  let sensor = "";
  for (let at = parsed.getElementById("calibration")?.nextElementSibling; at && at.tagName !== "H2"; at = at.nextElementSibling) {
    if (at.tagName === "H3") sensor = at.textContent;
    const own = at.matches("div.scroll") ? [at] : [...at.querySelectorAll("div.scroll")];
    const physical = own.filter((table) => table.querySelector("caption")?.textContent.startsWith("Physical"));
    for (const table of physical) tables.push(made("h3", { textContent: sensor }), document.importNode(table, true));
  }
  $("parameters").replaceChildren(...tables);
  $("report-part").hidden = false;
  await new Promise((loaded) => {
    $("report").onload = () => {
      const inside = $("report").contentDocument.documentElement;
      new ResizeObserver(() => ($("report").style.height = `${inside.scrollHeight + 4}px`)).observe(inside);
      loaded();
    };
    $("report").srcdoc = html;
  });
}

/** Hands a file to the browser's downloads. */
function save(name, bytes) {
  const link = made("a", { href: URL.createObjectURL(new Blob([bytes])), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60000);
}

/** Unit of the readings of the recording at work. */
async function rawUnit(mimu) {
  return /^raw_unit = "(.*)"$/m.exec(await mimu.text(`${state.recordings[0]}/recording.toml`))[1];
}

/** Keeps a result for the unit at work. */
function keepResult(of, text, rawUnit, from) {
  state.unit[of] = { text, rawUnit, from };
  if (!state.units.includes(state.unit)) state.units.push(state.unit);
}

/** Results of the unit from which one export can be made: all of them, or those for readings in the unit of the last log. */
async function together(mimu) {
  const unit = await rawUnit(mimu);
  return resultsOf(state.unit).filter(([, result]) => result.rawUnit === unit);
}

/** Offers the files made from this recording, and the formats for which the results suffice. */
async function keep(mimu, files) {
  const results = await together(mimu);
  for (const [name, { text }] of results) await mimu.write(name, text);
  const all = [...results.map(([name]) => name), ...files].map((name) => [name, name]);
  for (const [k, rec] of state.recordings.entries()) {
    const names = [...(await mimu.read(rec)).keys()];
    all.push(...names.map((name) => [`${rec}/${name}`, k ? `${rec}-${name}` : name]));
  }
  for (const [from, name] of all) {
    const bytes = await mimu.read(from);
    if (!bytes) continue;
    const button = made("button", { type: "button", textContent: name });
    button.addEventListener("click", () => guarded(async () => save(name, await mimu.read(from))));
    $("kept").append(button);
  }
  const has = (of) => results.some(([name]) => name === `${of}.toml`);
  const option = ({ name, file, of }, k) => made("option", { value: k, textContent: `${name} (${file})`, disabled: !has(of) });
  $("format").replaceChildren(...FORMATS.map(option));
  $("format").value = FORMATS.findIndex(({ of }) => has(of));
  const from = resultsOf(state.unit).map(([name, result]) => {
    const apart = results.some(([file]) => file === name) ? "" : "; its readings are in another unit than those of this log, so it is kept apart";
    return `${name} is that of the unit ${state.unit.name}, from ${result.from}, for readings in ${result.rawUnit}${apart}.`;
  });
  if (!has("noise")) from.push("Formats of estimators (Kalibr, OpenVINS ...) are made from noise: drop a recording at rest, and press “Noise of a unit at rest”.");
  $("made-from").textContent = from.join(" ");
  $("away").hidden = false;
  $("result-title").focus();
}

async function takeAway() {
  const { file, args } = FORMATS[$("format").value];
  $("exported").replaceChildren();
  await guarded(async () => {
    const mimu = state.program;
    const from = (await together(mimu)).flatMap(([name]) => [`--${name.split(".")[0]}`, name]);
    const of = args.map((argument) => (argument === "rec" ? state.recordings[0] : argument));
    const done = await mimu.run("export", ...of, ...from, "-o", file);
    save(file, await mimu.read(file));
    $("exported").replaceChildren(made("span", { className: "said", textContent: done.stdout.trim() }));
  }, $("exported"));
}

async function example() {
  await guarded(async () => {
    const files = await Promise.all(
      ["accel.txt", "gyro.txt"].map(async (name) => {
        const response = await fetch(`example/${name}`);
        if (!response.ok) throw new Refused(`example/${name}: the server answers ${response.status}; put all files of the page in one folder`);
        return new File([await response.blob()], name);
      }),
    );
    await open(files);
    $("gravity").value = "9.80665";
    state.example = true;
    await compute(calibrate);
  });
}

$("file").addEventListener("change", () => open($("file").files));
$("file").addEventListener("click", () => ($("file").value = ""));
$("example").addEventListener("click", example);
$("export").addEventListener("click", takeAway);
$("cancel").addEventListener("click", () => {
  cancel();
  $("columns-title").focus();
});
$("columns").addEventListener("submit", (event) => {
  event.preventDefault();
  compute(calibrate);
});
for (const [id, work] of [["verify-given", verifyGiven], ["apply-given", applyGiven]])
  $(id).addEventListener("click", () => $("columns").reportValidity() && compute(work));
$("trace").addEventListener("click", () => $("trace").classList.toggle("zoomed"));
$("noise").addEventListener("click", () => $("columns").reportValidity() && compute(noise));
addEventListener("dragover", (event) => {
  event.preventDefault();
  $("drop").classList.add("over");
});
addEventListener("dragleave", (event) => event.relatedTarget ?? $("drop").classList.remove("over"));
addEventListener("drop", (event) => {
  event.preventDefault();
  $("drop").classList.remove("over");
  open(event.dataTransfer.files);
});
offerBoards({ guarded, refuse, save, done: finished });
load().catch((error) => refuse(error.message));
if ("serviceWorker" in navigator && isSecureContext) navigator.serviceWorker.register("sw.js").catch(() => {});
