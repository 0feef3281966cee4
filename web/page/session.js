// The state of a session as the page shows it: what to do next, how far it is, what was received and what has happened.

import { $, made } from "./elements.js";
import { pose } from "./pose.js";
import { now } from "./serial.js";
import { sphere } from "./sphere.js";

const digits = (value) => Number(value.toPrecision(3)).toString();
const capital = (words) => words.slice(0, 1).toUpperCase() + words.slice(1);
const WAITING = { "warm-up": "Leave the board still.", diagnosis: "The dwells are evaluated …", store: "The dwells are evaluated …" };

/** `journal` reads the journal of the session that is shown. */
let shown = {};

/** Begins to show a session whose journal is read by `journal`. */
export function begin(journal) {
  shown = { journal, part: "calibration", step: null, told: [], rate: 0, counted: null };
  for (const id of ["log", "heard", "aims", "not-yet", "session-sphere", "pose", "held", "phase", "count", "field-off"]) $(id).replaceChildren();
  $("session-bar").value = $("dwell-bar").value = 0;
  $("prompt").textContent = WAITING["warm-up"];
  $("state").textContent = "Its rate is being found …";
}

/** Adds lines to what has happened. */
export function log(lines) {
  const list = $("log");
  const below = list.scrollHeight - list.scrollTop - list.clientHeight < 8;
  list.append(...lines.filter((line) => line.trim()).map((line) => made("li", { textContent: line.trim() })));
  if (below) list.scrollTop = list.scrollHeight;
}

/** Shows an event. */
export function tell(event) {
  events[event.event]?.(event);
}

/** Shows that the session is over: `done`, or stopped. */
export function end(done) {
  $("pose").replaceChildren();
  $("state").textContent = $("field-off").textContent = "";
  $("dwell-bar").value = 0;
  if (done) $("session-bar").value = 1;
  $("prompt").textContent = done ? "The session is finished." : "The session is stopped. It goes on from the last dwell, here or by the command with the journal.";
}

const events = {
  greeted({ told }) {
    shown.told = told;
  },
  phase({ phase, words }) {
    if (["verification", "confirmation", "calibration"].includes(phase)) shown.part = phase;
    $("phase").textContent = `${capital(phase)}: ${words}`;
    $("pose").replaceChildren();
    shown.step = null;
    $("prompt").textContent = WAITING[phase] ?? "";
    $("state").textContent = "";
    $("turns").hidden = true;
    poses();
  },
  step({ step, words, done, planned }) {
    shown.step = { ...step, words };
    buttons(false);
    $("prompt").textContent = capital(words);
    $("pose").replaceChildren(made("p", { className: "dim", textContent: "wanted" }), pose(step.up, words));
    say(words);
    $("session-bar").value = done / planned;
    $("count").textContent = `pose ${done + 1} of ${planned}`;
    poses();
  },
  spin({ step, words, done, planned }) {
    shown.step = { ...step, words };
    // First the rest, then the turns.
    shown.spin = words.split("; then ");
    $("prompt").textContent = capital(shown.spin[0]);
    buttons(true);
    $("pose").replaceChildren(made("p", { className: "dim", textContent: "at rest, this side up" }), pose(step.up, words));
    say(shown.spin[0]);
    $("session-bar").value = done / planned;
    $("count").textContent = `whole turns ${done + 1} of ${planned}`;
    poses();
  },
  turned({ turns }) {
    if (turns) return say(`${turns}`);
    $("prompt").textContent = capital(shown.spin[1]);
    say(shown.spin[1]);
  },
  spun: () => beep(),
  "spin-lost"({ why }) {
    $("prompt").textContent = capital(shown.spin[0]);
    say(`These turns cannot be used: ${why}. Again: ${shown.spin[0]}`);
  },
  dwell() {
    beep();
    poses();
  },
  redo: () => poses(),
  field: ({ words }) => say(words),
  progress: ({ progress }) => aims(progress),
};

/** Names what the buttons do to a dwell, or to whole turns. */
function buttons(spins) {
  $("redo").textContent = spins ? "Begin these turns anew" : "Repeat the last dwell";
  $("skip").textContent = spins ? "These turns later" : "This pose later";
}

/** Says `words`, if the person wants it: hands and eyes are at the unit. */
function say(words) {
  if (!$("aloud").checked || !("speechSynthesis" in window)) return;
  speechSynthesis.cancel();
  speechSynthesis.speak(new SpeechSynthesisUtterance(words.replaceAll("+", "plus ").replaceAll("-", "minus ")));
}

let sound;
/** A short tone, if the person wants it. */
function beep() {
  if (!$("aloud").checked) return;
  sound ??= new AudioContext();
  const tone = sound.createOscillator(), level = sound.createGain();
  tone.connect(level).connect(sound.destination);
  tone.frequency.value = 880;
  level.gain.setValueAtTime(0.2, sound.currentTime);
  level.gain.exponentialRampToValueAtTime(0.001, sound.currentTime + 0.25);
  tone.start();
  tone.stop(sound.currentTime + 0.25);
}

/** Shows the poses of this part from the journal, and the next one. */
async function poses() {
  const text = await shown.journal();
  const had = new Map();
  for (const line of text.split("\n").filter(Boolean)) {
    const entry = JSON.parse(line);
    if (entry.part !== shown.part) continue;
    if (entry.entry === "dwell") had.set(entry.number, entry.step.up);
    if (entry.entry === "redo") had.delete(entry.number);
  }
  const next = shown.step && { up: shown.step.up, words: shown.step.words };
  $("session-sphere").replaceChildren(sphere({ poses: [...had.values()], map: [], cell: 0, next }));
}

function aims({ sensors, not_yet: why }) {
  const rows = sensors.flatMap(({ sensor, aims }) =>
    aims.map(({ parameter, axis, half_width: half, target, unit }) => {
      const met = half <= target;
      const bar = made("progress", { max: 1, value: Math.min(1, target / half) });
      bar.setAttribute("aria-label", `${sensor} ${parameter}: target over interval`);
      return made("tr", { className: met ? "met" : "" }, made("td", { textContent: `${met ? "✓ " : ""}${sensor} ${parameter} ${axis}` }), made("td", { className: "n", textContent: `±${digits(half)}` }),
        made("td", { textContent: `of ±${digits(target)} ${unit}` }), made("td", {}, bar));
    }),
  );
  const caption = made("caption", { textContent: "95 % intervals of the worst axis, beside what is wanted" });
  $("aims").replaceChildren(...(rows.length ? [caption, made("tbody", {}, ...rows)] : []));
  $("not-yet").textContent = rows.length ? "" : `Not determined yet: ${why ?? "more poses are needed"}`;
}

/** Shows the state of the unit: what it waits for, and what was received from it. */
export function stand({ units: [unit], phase, step }) {
  if (!unit) return;
  // The pose in which the unit is, beside the one that is wanted, until it is taken.
  const off = step && unit.up && unit.tilt_deg !== null && unit.tilt_deg > unit.tilt_limit_deg;
  const words = off ? `${Math.round(unit.tilt_deg)}° off` : "";
  if (shown.off !== words || off) {
    shown.off = words;
    $("held").replaceChildren(...(off ? [made("p", { className: "dim", textContent: `now, ${words}` }), pose(unit.up, "the present pose")] : []));
  }
  const spin = unit.spin;
  const turning = spin?.turns ?? null;
  $("turns").hidden = turning === null;
  if (turning !== null) {
    $("turns-now").textContent = turning.toFixed(1);
    $("turns-of").textContent = `of ${spin.asked} turns about ${spin.axis.slice(1)}`;
  }
  const running = unit.left_s !== null && step;
  $("dwell-bar").value = running ? Math.min(1, Math.max(0, 1 - unit.left_s / step.dwell_s)) : 0;
  if (running) $("state").textContent = `Keep it still: ${unit.left_s.toFixed(1)} s`;
  else if (unit.waiting) $("state").textContent = turning === null ? `Waiting: ${unit.waiting}` : `${capital(unit.waiting)}.`;
  else if (step) $("state").textContent = `Turn it so, and let it rest for ${digits(step.dwell_s)} s.`;
  else if (phase === "warm-up") $("state").textContent = "It is being listened to at rest.";
  $("field-off").textContent = unit.field ? `${capital(unit.field)}.` : "";
  const at = now();
  const before = shown.counted;
  if (!before || at - before.at > 1 || unit.samples < before.samples) {
    if (before && unit.samples > before.samples) shown.rate = (unit.samples - before.samples) / (at - before.at);
    shown.counted = { at, samples: unit.samples };
  }
  const times = (motion) => (motion === null ? "–" : `${motion < 10 ? motion.toFixed(1) : Math.round(motion)}`);
  const rows = {
    Line: shown.told.join("; "),
    "Rate now": shown.rate ? `${digits(shown.rate)} samples a second` : "",
    Samples: `${unit.samples}; ${unit.lost} missing; ${unit.clipped} at the end of a range`,
    Motion: unit.motion ? `gyro ${times(unit.motion[0])}, accelerometer ${times(unit.motion[1])} times what counts as rest` : "",
    Temperature: unit.temp_c === null ? "" : `${unit.temp_c.toFixed(1)} °C${unit.trend_c_per_min === null ? "" : `, ${unit.trend_c_per_min.toFixed(2)} °C/min`}`,
  };
  const lines = Object.entries(rows).filter(([, text]) => text);
  const terms = [...$("heard").querySelectorAll("dd")];
  // Elements that are kept can be selected and read aloud.
  if (terms.length === lines.length) lines.forEach(([, text], k) => terms[k].textContent !== text && (terms[k].textContent = text));
  else $("heard").replaceChildren(...lines.flatMap(([name, text]) => [made("dt", { textContent: name }), made("dd", { textContent: text })]));
}
