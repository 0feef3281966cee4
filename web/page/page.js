// The page: from dropped files to a calibration, one step after the other.

import { FORMATS } from "./exports.js";
import { FIELD_OF, cut, importArguments, show } from "./fields.js";
import { Cancelled, Program, Refused, load } from "./program.js";
import { sphere } from "./sphere.js";

const $ = (id) => document.getElementById(id);

/** The files that were dropped last, what was found in them, and what was computed. */
const state = { files: [], looked: null, program: null, calibration: null, began: 0 };

function made(name, properties, ...children) {
  const element = Object.assign(document.createElement(name), properties);
  element.append(...children);
  return element;
}

/** Text in which the arguments of the command lead to the field that sets them. */
function withFields(text) {
  return text.split(/(--[a-z-]+)/).map((part) => {
    const id = FIELD_OF[part];
    if (!id) return part;
    const button = made("button", { type: "button", className: "field-link", textContent: part });
    button.addEventListener("click", () => {
      const target = id === "files" ? $("files").querySelector("select") : $(id);
      target?.closest("details")?.setAttribute("open", "");
      (target ?? $("columns-title")).focus();
    });
    return button;
  });
}

function refuse(line) {
  $("error").replaceChildren(...withFields(line));
  $("error").hidden = !line;
  if (line) $("error").scrollIntoView({ block: "nearest" });
}

function status(text, share) {
  $("status").textContent = text;
  if (share === undefined) $("bar").removeAttribute("value");
  else $("bar").value = share;
}

/** The program, with the dropped files in its folder. */
async function program() {
  state.program ??= new Program(({ file, share }) => status(`reading ${file}: ${Math.round(100 * share)} %`, share));
  await state.program.files(state.files);
  return state.program;
}

/** Names under which the files stand in the folder: no two alike, none that reads like an argument. */
function named(files) {
  const taken = new Set();
  return [...files].map((file) => {
    let name = file.name.replace(/^-+/, "").replace(/[/\\]/g, "_") || "log";
    while (taken.has(name)) name = `another-${name}`;
    taken.add(name);
    return { name, file };
  });
}

/** What may fail runs in here: its line is shown, and the page goes on. */
async function guarded(work) {
  refuse("");
  try {
    await work();
  } catch (error) {
    if (error instanceof Cancelled) return;
    refuse(error instanceof Refused ? error.message : `this page has a fault (${error?.message ?? error}); load it again, and report it if it comes back`);
    if (!(error instanceof Refused)) console.error(error);
  }
}

async function open(files) {
  if (files.length === 0) return;
  cancel();
  state.files = named(files);
  state.began = performance.now();
  $("result").hidden = $("work").hidden = true;
  await guarded(async () => {
    $("columns").hidden = true;
    const mimu = await program();
    const done = await mimu.run("columns", ...state.files.map(({ name }) => name));
    state.looked = JSON.parse(done.stdout);
    show(state.looked);
    $("columns").hidden = false;
    $("columns-title").focus();
  });
}

/** Ends what is being computed. */
function cancel() {
  state.program?.end();
  state.program = null;
}

/** A step of the work, as a line in the list. */
async function step(title, work) {
  const line = made("li", { textContent: title });
  $("steps").append(line);
  status(`${title} …`);
  const begun = performance.now();
  try {
    const result = await work();
    line.className = "done";
    line.append(`: ${((performance.now() - begun) / 1000).toFixed(1)} s`);
    return result;
  } catch (error) {
    line.className = "refused";
    line.append(error instanceof Cancelled ? ": cancelled" : ": refused");
    throw error;
  }
}

async function calibrate() {
  $("result").hidden = true;
  $("steps").replaceChildren();
  $("work").hidden = false;
  $("progress").hidden = false;
  $("work-title").focus();
  for (const id of ["errors", "warnings", "trace", "sphere", "kept", "next", "exported", "verdict"]) $(id).replaceChildren();
  $("report-part").hidden = $("away").hidden = $("pictures").hidden = $("verdict").hidden = true;
  await guarded(async () => {
    try {
      await steps();
    } finally {
      $("progress").hidden = true;
      status("");
    }
  });
}

async function steps() {
  const mimu = await program();
  const more = cut($("more-fit").value);
  const names = state.files.map(({ name }) => name);
  await step("Import", () => mimu.run(...importArguments(state.looked, names)));
  warn((await mimu.json("import.json")).warnings);
  // The readings are shown even if they cannot be fitted: there one sees why.
  let fitted;
  const fit = step("Calibration", () => mimu.run("fit", "rec", "-o", "cal.toml", "--json", "fit.json", ...more)).then(
    (done) => (fitted = done),
    (why) => why,
  );
  const why = await fit;
  if (why instanceof Cancelled) throw why;
  const view = await step("Readings and poses", () => mimu.run("view", "rec", ...(fitted ? ["cal.toml"] : [])));
  picture(JSON.parse(view.stdout));
  $("result").hidden = false;
  if (!fitted) throw why;
  state.calibration = "cal.toml";
  warn((await mimu.json("fit.json")).warnings);
  const said = made("details", {}, made("summary", { textContent: "What mimu fit prints" }), made("div", { className: "scroll", tabIndex: 0 }, made("pre", { textContent: fitted.stdout })));
  $("errors").replaceChildren(said);
  const shared = more.filter((_, k) => more[k] !== "--only" && more[k - 1] !== "--only");
  const found = await step("Diagnosis", () =>
    mimu.run("diagnose", "rec", "-o", "calibration.toml", "--json", "diagnosis.json", "--page", "report.html", ...shared),
  ).catch((error) => error);
  if (found instanceof Error && !(found instanceof Refused)) throw found;
  if (!(found instanceof Error)) {
    state.calibration = "calibration.toml";
    warn((await mimu.json("diagnosis.json")).warnings);
    await report(await mimu.text("report.html"));
  }
  await keep(mimu);
  $("result-title").focus();
  if (found instanceof Error) throw found;
}

function warn(warnings) {
  const known = new Set([...$("warnings").children].map((line) => line.textContent));
  for (const warning of warnings ?? []) {
    const text = typeof warning === "string" ? warning : warning.message ?? JSON.stringify(warning);
    if (!known.has(text)) $("warnings").append(made("li", {}, ...withFields(text)));
  }
}

function picture(view) {
  $("pictures").hidden = false;
  // The program's own drawing; it escapes what it is handed.
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

/** Shows the report, and its verdict and errors above. */
async function report(html) {
  const parsed = new DOMParser().parseFromString(html, "text/html");
  const verdict = parsed.querySelector(".verdict");
  $("verdict").className = verdict.className;
  $("verdict").replaceChildren(...document.importNode(verdict, true).childNodes);
  $("verdict").hidden = false;
  const errors = parsed.querySelector("table");
  if (errors) $("errors").prepend(document.importNode(errors, true));
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

async function keep(mimu) {
  $("away").hidden = false;
  const recording = await mimu.read("rec");
  const all = [
    [state.calibration, "calibration.toml"],
    ["fit.json", "fit.json"],
    ["diagnosis.json", "diagnosis.json"],
    ["report.html", "report.html"],
    ...[...recording.keys()].map((name) => [`rec/${name}`, name]),
  ];
  for (const [from, name] of all) {
    const bytes = await mimu.read(from);
    if (!bytes) continue;
    const button = made("button", { type: "button", textContent: name });
    button.addEventListener("click", () => guarded(async () => save(name, await mimu.read(from))));
    $("kept").append(button);
  }
}

async function takeAway() {
  const { file, args } = FORMATS[$("format").value];
  $("exported").replaceChildren();
  await guarded(async () => {
    const done = await state.program.run("export", ...args, "--calibration", state.calibration, "-o", file);
    save(file, await state.program.read(file));
    $("exported").replaceChildren(made("span", { className: "said", textContent: done.stdout.trim() }));
  });
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
    await calibrate();
  });
}

FORMATS.forEach(({ name, file }, k) => $("format").append(made("option", { value: k, textContent: `${name} (${file})` })));
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
  calibrate();
});
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
load().catch((error) => refuse(error.message));
if ("serviceWorker" in navigator && isSecureContext) navigator.serviceWorker.register("sw.js").catch(() => {});
