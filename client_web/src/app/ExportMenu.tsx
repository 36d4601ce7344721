/** Pictures to take away: PNG and EXR with one click each; EXR without its layers, and turntables of views that move. */
import { useState } from "preact/hooks";
import { exportExr, exportPng, exportTurntable, TURNTABLE_FRAMES, turns, type Turns } from "../looks/export";
import { exporting } from "../looks/rendering";
import { stage } from "../picture/stage";
import { lightLimitWords } from "../seen/limits";
import { exrSpace, exrSpaceHere, spaces } from "../state/color";
import { drawn } from "../state/display";
import { look } from "../state/look";
import { moves, sideBySide, viewName } from "../state/views";

/** What an export is of: with several views shown it must be said. */
function whichView(): string {
  return sideBySide.value ? `the view “${viewName.value}”` : "the picture";
}

interface Choice {
  label: string;
  help: string;
  run(): Promise<void>;
}

const PICTURES: Choice[] = [
  {
    label: "EXR with layers",
    help: "One for each light and each kind of light path, beside the picture",
    run: () => exportExr(true),
  },
  {
    label: "EXR with light groups",
    help: "Direct and reflected light of each light; together they are the picture",
    run: () => exportExr("light_groups"),
  },
  { label: "EXR, the picture alone", help: "Quicker, and a smaller file", run: () => exportExr(false) },
];

const TURNTABLES: Choice[] = [
  {
    label: "Turntable, quick",
    help: `${TURNTABLE_FRAMES} frames once around, as the view looks while it moves; PNG in a ZIP`,
    run: () => exportTurntable("png", false),
  },
  {
    label: "Turntable, exact",
    help: `Each of ${TURNTABLE_FRAMES} frames as where the eye rests; takes as long for each`,
    run: () => exportTurntable("png", true),
  },
  { label: "Turntable as a video", help: "The quick one as MP4", run: () => exportTurntable("mp4", false) },
];

const TURNS: Record<Turns, string> = {
  eye: "the eye goes around",
  object: "the object turns, under light that stays",
  environment: "the environment turns alone",
};

/** What the turntables turn. */
function WhatTurns() {
  return (
    <li>
      <label>
        Turntable
        <select value={turns.value} onChange={(event) => (turns.value = event.currentTarget.value as Turns)}>
          {Object.entries(TURNS).map(([value, words]) => (
            <option key={value} value={value}>
              {words}
            </option>
          ))}
        </select>
      </label>
    </li>
  );
}

/** Which colour space EXR files are in, where the server has a config. */
function Space() {
  return (
    <li>
      <label>
        EXR in
        <select value={exrSpaceHere.value ?? ""} onChange={(event) => (exrSpace.value = event.currentTarget.value)}>
          <option value="">linear Rec. 709</option>
          {spaces.value.map((name) => (
            <option key={name} value={name}>
              {name}
            </option>
          ))}
        </select>
      </label>
    </li>
  );
}

export function ExportMenu() {
  const [open, setOpen] = useState(false);
  drawn.value;
  const none = look.value === null || !stage.active.isThere;
  const busy = none || exporting.value !== null;
  const escape = (event: KeyboardEvent) => {
    if (event.key !== "Escape" || !open) return;
    event.stopPropagation(); // a menu that the buttons are in stays
    setOpen(false);
  };
  return (
    <div class="menu" onKeyDown={escape}>
      <div class="group" role="group" aria-label="Export">
        <button
          title={`Export ${whichView()} as displayed (Ctrl+Shift+S)${lightLimitWords()}`}
          disabled={none}
          onClick={() => void exportPng()}
        >
          PNG
        </button>
        <button
          title={`Export the linear radiance of ${whichView()}${exrSpaceHere.value === null ? "" : ` in ${exrSpaceHere.value}`}, with a layer for each light${lightLimitWords()}`}
          disabled={busy}
          onClick={() => void exportExr(true)}
        >
          EXR
        </button>
        <button aria-label="More ways to export" title="More ways to export" aria-expanded={open} onClick={() => setOpen(!open)}>
          ▾
        </button>
      </div>
      {open && (
        <ul class="menu-body export-menu">
          {(moves.value ? [...PICTURES, ...TURNTABLES] : PICTURES).map(({ label, help, run }) => (
            <li key={label}>
              <button
                disabled={busy}
                onClick={() => {
                  setOpen(false);
                  void run();
                }}
              >
                {label}
              </button>
              <span>{help}</span>
            </li>
          ))}
          {moves.value && <WhatTurns />}
          {spaces.value.length > 0 && <Space />}
        </ul>
      )}
    </div>
  );
}
