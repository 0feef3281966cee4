// A session with a board at a serial port: what it writes, what to do next, how far it is, and the journal. The program conducts the session; this
// file handles the port, the prompts and the person's answers.

import { unzip, zip } from "./archive.js";
import { $, made } from "./elements.js";
import { cut } from "./fields.js";
import { Program, Refused } from "./program.js";
import { NO_SERIAL, Port, now } from "./serial.js";
import * as session from "./session.js";

/** Field that sets an argument of `mimu wizard`. */
const FIELDS = {
  "--gravity": "board-gravity", "--latitude": "board-latitude", "--baud": "baud", "--text": "line-columns", "--raw-unit": "board-unit",
  "--field": "board-field", "--device": "board-name", "--fixture": "board-fixture", "--dwell": "board-dwell", "--whole-turns": "board-turns",
};

/** Roles of the numbers in a line, as in `--text`. */
const COLUMNS = [
  ["-", "not used"], ["t_us", "time, µs"], ["t_ms", "time, ms"], ["t_s", "time, s"],
  ...["gyro", "accel", "mag"].flatMap((sensor) => ["x", "y", "z"].map((axis) => [sensor[0] + axis, `${sensor} ${axis}`])),
  ["temp_c", "temperature, °C"],
];

// Seconds of the board's output that are collected before it is shown, and the longest wait for the first byte.
const LOOK_S = 2.5, SILENT_S = 5;
// Interval at which the program is told the time, ms.
const TICK = 100;
const FOLDER = "session";

const port = new Port(heard, lost);
/** `stage`: `none` (not connected, or ended), `look` (the lines are examined) or `session`. */
const board = { stage: "none", text: "", first: null, queue: [], hearing: false, goesOn: false, saved: true, guessed: [], motionCal: false };
let page;

let worker;
/** The program in a separate worker, which keeps the folder of the session. */
const program = () => (worker ??= new Program(() => {}, said));

const sleep = (ms) => new Promise((done) => setTimeout(done, ms));

/** Bytes as the characters with these codes, so that garbled bytes stay unchanged. */
function characters(bytes) {
  let text = "";
  for (let at = 0; at < bytes.length; at += 8192) text += String.fromCharCode(...bytes.subarray(at, at + 8192));
  return text;
}

function heard(at, bytes) {
  if (board.stage === "session") return tell({ bytes: [at, characters(bytes)] });
  if (board.stage !== "look") return;
  board.first ??= at;
  board.last = at;
  board.text += characters(bytes);
}

function lost(at, why) {
  if (board.stage === "session") {
    tell({ lost: [at, why] });
    $("reconnect").hidden = false;
  } else if (board.stage === "look") {
    board.stage = "none";
    page.refuse(`${why}; check the cable, plug the board in, and connect it again`, $("board-form"), FIELDS);
  }
}

const attempt = (work, place) => page.guarded(work, $(place), FIELDS);

async function connect() {
  if (!Port.exists) throw new Refused(NO_SERIAL);
  await port.close();
  await port.choose();
  await look();
}

/** Names of the numbers for `--text`. MotionCal's lines are recognised by their label, which the names do not contain. */
function columnNames() {
  const columns = [...document.querySelectorAll("#line-columns select")].map((select) => select.value);
  const asked = columns.join() === board.guessed.join() && (board.motionCal ? "ax,ay,az,gx,gy,gz" : null);
  return asked || columns.join();
}

/** Opens the port, and shows what the board writes and the guessed roles. */
async function look() {
  await port.close();
  Object.assign(board, { stage: "look", text: "", first: null, last: null });
  await port.open(Number($("baud").value));
  $("line").hidden = false;
  $("lines").textContent = "";
  $("line-columns").replaceChildren();
  $("line-taken").textContent = "Listening …";
  const begun = now();
  while (board.stage === "look" && now() - (board.first ?? begun) < (board.first ? LOOK_S : SILENT_S)) await sleep(50);
  if (board.stage !== "look") return;
  board.stage = "none";
  if (!board.text) {
    $("line-taken").textContent = "";
    throw new Refused("nothing has come from the board in 5 s; check that its program writes to this port, reset it, and look again (--baud)");
  }
  await program().write("board.txt", board.text);
  const done = await program().run("board", "board.txt", String(board.last - board.first));
  showLine(JSON.parse(done.stdout));
  $("line-title").focus();
}

function showLine({ shown, names, rows, columns, by_readings: guessed, si }) {
  $("lines").textContent = shown.join("\n");
  if (columns.length === 0) {
    $("line-taken").textContent = "";
    throw new Refused(`no line of the board has six numbers or more, the last is ${JSON.stringify(shown.at(-1) ?? "")}; if this is garbage, give the bits a second that its program sets (--baud), else have it write all readings in one line`);
  }
  const kept = board.asked?.columns;
  const chosen = kept?.length === columns.length ? kept : columns;
  board.guessed = columns;
  board.motionCal = columns.length === 9 && shown.some((line) => line.startsWith("Raw:"));
  $("line-columns").replaceChildren(
    ...columns.map((_, at) => {
      const select = made("select", { id: `line-role-${at}` }, ...COLUMNS.map(([value, text]) => made("option", { value, textContent: text })));
      select.value = chosen[at];
      const label = made("span", { className: "label", textContent: names[at] ?? `number ${at + 1}` });
      const cells = made("span", { className: "cells", textContent: rows.map((row) => row[at]).join("  ") });
      const item = made("li", { className: "column" }, made("label", {}, label, cells, select));
      const mark = () => item.classList.toggle("unused", select.value === "-");
      select.addEventListener("change", mark);
      mark();
      return item;
    }),
  );
  if (!board.asked) $("board-unit").value = si === null ? "" : si ? "SI" : "count";
  $("line-taken").textContent = guessed
    ? "The lines have no names, so they were guessed from the readings at rest. Check them: accelerometer and gyro are easily exchanged."
    : "By the names that the board writes. Correct what is wrong.";
}

/** Arguments of `mimu wizard`. */
function wizardArguments() {
  const number = (id) => $(id).value.trim().replace(",", ".");
  const args = ["wizard", "-o", FOLDER, "--port", "USB", "--text", columnNames()];
  args.push("--baud", number("baud"), "--raw-unit", $("board-unit").value, "--device", $("board-name").value.trim());
  args.push("--fixture", $("board-fixture").value, "--dwell", number("board-dwell"));
  const more = cut($("more-wizard").value);
  // With a number or a placement, they are given among the other arguments.
  if ($("board-turns").checked && !more.some((arg) => arg.startsWith("--whole-turns"))) args.push("--whole-turns");
  for (const name of ["gravity", "latitude", "field"]) if (number(`board-${name}`)) args.push(`--${name}=${number(`board-${name}`)}`);
  return [...args, ...more];
}

async function begin() {
  if (!port.isOpen) await port.open(Number($("baud").value));
  // A session without a dwell, or a finished one, is not resumed.
  if (!board.goesOn) await program().ask("unpack", { name: FOLDER, files: new Map() });
  const warnings = await program().begin(...wizardArguments());
  Object.assign(board, { stage: "session", queue: [] });
  session.begin(async () => (await program().text(`${FOLDER}/journal.jsonl`)) ?? "");
  session.log(warnings);
  $("line").hidden = true;
  $("session").hidden = false;
  for (const id of ["go-on", "reconnect", "question", "forget"]) $(id).hidden = true;
  for (const id of ["stop", "redo", "skip"]) $(id).hidden = false;
  $("stop").disabled = false;
  $("session-title").focus();
  tell({ opened: now() });
}

/** Sends a line to the program. Lines that come while it computes are queued with their times. */
function tell(line) {
  board.queue.push(line);
  pump();
}

async function pump() {
  if (board.hearing) return;
  board.hearing = true;
  try {
    while (board.queue.length > 0 && board.stage === "session") await program().hear(board.queue.splice(0));
  } finally {
    board.hearing = false;
  }
}

setInterval(() => board.stage === "session" && tell({ time: now() }), TICK);

/** Handles a message of the program. */
function said(message) {
  if (message.standing) return session.stand(message.standing);
  if (message.question) return ask(message.question);
  if (message.ended) return ended(message.ended);
  const { event, lines } = message;
  session.log(lines);
  session.tell(event);
  if (event.event === "dwell") Object.assign(board, { goesOn: true, saved: false });
  if (event.event === "resumed") board.goesOn = true;
  if (event.event === "interrupted") $("reconnect").hidden = port.isOpen;
}

function ask(words) {
  $("question-words").textContent = words[0].toUpperCase() + words.slice(1);
  $("question").hidden = false;
  $("yes").focus();
}

function answer(yes) {
  $("question").hidden = true;
  tell({ answer: yes });
}

async function ended({ outcome, text, refused }) {
  board.stage = "none";
  await port.close();
  const done = outcome && !outcome.cancelled;
  for (const id of ["stop", "redo", "skip", "reconnect", "question"]) $(id).hidden = true;
  $("go-on").hidden = Boolean(done);
  $("forget").hidden = !board.goesOn || Boolean(done);
  session.end(done);
  if (done) {
    board.goesOn = false;
    session.log(text.split("\n"));
  }
  if (refused) page.refuse(refused, $("session"), FIELDS);
  if (done) await result();
}

/** Hands the recordings of the session to the page, to be fitted and exported like those of a file. */
async function result() {
  const files = await program().read(FOLDER);
  const field = $("board-field").value.trim().replace(",", ".");
  if (files?.has("calibration/samples.csv")) await page.done(files, $("board-name").value.trim(), field ? [`--field=${field}`] : []);
}

async function reconnect() {
  const baud = Number($("baud").value);
  // The same port as before can be opened without asking.
  await port.open(baud).catch(async () => {
    await port.choose();
    await port.open(baud);
  });
  $("reconnect").hidden = true;
  tell({ opened: now() });
}

async function keepJournal() {
  const files = await program().read(FOLDER);
  if (!files?.size) throw new Refused("there is no journal yet: it begins with the session; connect a board");
  page.save(`${$("board-name").value.trim() || "session"}.zip`, zip(files));
  board.saved = true;
}

/** Loads a journal that was downloaded here, or the folder of `mimu wizard -o` as a ZIP. */
export async function loadJournal(file) {
  await attempt(async () => {
    if (board.stage === "session") throw new Refused("a session runs; stop it before another journal is loaded");
    const files = await unzip(new Uint8Array(await file.arrayBuffer()));
    if (!files) throw new Refused(`${file.name}: this is no ZIP archive that can be read, or it is cut; choose what “Download the journal” has made, or a ZIP of the folder of mimu wizard -o`);
    const inside = [...files.keys()].find((path) => path === "session.json" || path.endsWith("/session.json"));
    if (!inside) throw new Refused(`${file.name}: there is no session.json in it; choose what “Download the journal” has made, or a ZIP of the folder of mimu wizard -o`);
    const before = inside.slice(0, -"session.json".length);
    const own = new Map([...files].filter(([path]) => path.startsWith(before)).map(([path, bytes]) => [path.slice(before.length), bytes]));
    const text = (name) => new TextDecoder().decode(own.get(name) ?? new Uint8Array(0));
    let begun, entries;
    try {
      begun = JSON.parse(text("session.json"));
      entries = text("journal.jsonl").split("\n").slice(0, -1).map((line) => JSON.parse(line));
    } catch (error) {
      throw new Refused(`${file.name}: its session cannot be read (${error.message}); download the journal again, or begin anew`);
    }
    if (!begun.asked?.text) throw new Refused(`${file.name}: it is of a mimu device, which the page does not talk to; go on with it by mimu wizard`);
    await program().ready;
    await program().ask("unpack", { name: FOLDER, files: own });
    const [, names, unit] = /^(.*) in (\S+)$/.exec(begun.asked.text);
    board.asked = { columns: names.split(",") };
    const { gravity_mps2: gravity, latitude_deg: latitude, fixture, dwell_s: dwell, whole_turns: whole, field_ut: field } = begun.asked;
    const fields = { "board-name": begun.unit_id, "board-unit": unit, "board-gravity": gravity, "board-latitude": latitude ?? "", "board-field": field ?? "", "board-fixture": fixture, "board-dwell": dwell };
    for (const [id, value] of Object.entries(fields)) $(id).value = value;
    $("board-turns").checked = Boolean(whole);
    // What the checkbox does not say.
    if (whole && (whole.turns || whole.placement_deg !== 1)) $("more-wizard").value = `--whole-turns${whole.turns ? `=${whole.turns}` : ""} --placement ${whole.placement_deg}`;
    board.goesOn = true;
    const dwells = entries.filter(({ entry }) => entry === "dwell").length - entries.filter(({ entry }) => entry === "redo").length;
    const finished = entries.at(-1)?.entry === "done";
    $("forget").hidden = false;
    $("loaded").textContent = `${begun.unit_id}: ${dwells} dwells${finished ? ", finished." : "; connect the board to go on."}`;
    if (finished) await result();
  }, "board-form");
}

/** Sets up the part for boards. `to`: functions of the page for all of its parts. */
export function offerBoards(to) {
  page = to;
  $("no-serial").hidden = Port.exists;
  $("no-serial").textContent = NO_SERIAL[0].toUpperCase() + NO_SERIAL.slice(1) + ".";
  $("connect").disabled = !Port.exists;
  $("board-form").addEventListener("submit", (event) => {
    event.preventDefault();
    attempt(connect, "board-form");
  });
  $("journal").addEventListener("change", () => $("journal").files[0] && loadJournal($("journal").files[0]));
  $("journal").addEventListener("click", () => ($("journal").value = ""));
  $("line").addEventListener("submit", (event) => {
    event.preventDefault();
    attempt(begin, "line");
  });
  const on = (id, place, work) => $(id).addEventListener("click", () => attempt(work, place));
  on("look-again", "line", look);
  on("disconnect", "board-form", async () => {
    board.stage = "none";
    $("line").hidden = true;
    await port.close();
  });
  on("go-on", "session", begin);
  on("forget", "board-form", async () => {
    if (!board.saved && !confirm("The journal of this session has not been downloaded. Discard it all the same?")) return;
    Object.assign(board, { goesOn: false, saved: true, asked: null });
    $("loaded").textContent = "";
    $("session").hidden = $("forget").hidden = true;
  });
  on("reconnect", "session", reconnect);
  on("keep-journal", "session", keepJournal);
  $("stop").addEventListener("click", () => {
    $("stop").disabled = true;
    tell({ wish: "cancel" });
  });
  $("redo").addEventListener("click", () => tell({ wish: "redo-last" }));
  $("skip").addEventListener("click", () => tell({ wish: "skip" }));
  $("yes").addEventListener("click", () => answer(true));
  $("no").addEventListener("click", () => answer(false));
  navigator.serial?.addEventListener("connect", () => {
    if (board.stage === "session" && !port.isOpen) port.open(Number($("baud").value)).then(() => (($("reconnect").hidden = true), tell({ opened: now() })), () => {});
  });
  addEventListener("beforeunload", (event) => board.saved || event.preventDefault());
}
