/** Images to take away: PNG and EXR with one click each; EXR without its layers, and turntables of views that move. */
import { useState } from "preact/hooks";
import { exportExr, exportPng, exportTurntable, TURNTABLE_FRAMES, turntableRotation, type TurntableRotation } from "../panels/looks/exportImage";
import { exporting } from "../panels/looks/renderJob";
import { stage } from "../render/renderStage";
import { lightFilterText } from "../state/visibility/activeFilters";
import { exrSpace, availableExrSpace, exrSpaces } from "../state/color";
import { displayedFrames } from "../state/display";
import { look } from "../state/look";
import { hasFreeCamera, sideBySide, activeViewName } from "../state/views";

/** What an export is of: with several views shown it must be said. */
function exportTargetLabel(): string {
  return sideBySide.value ? `the view “${activeViewName.value}”` : "the picture";
}

interface ExportOption {
  label: string;
  help: string;
  run(): Promise<void>;
}

const IMAGE_EXPORTS: ExportOption[] = [
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

const TURNTABLE_EXPORTS: ExportOption[] = [
  {
    label: "Turntable, quick",
    help: `${TURNTABLE_FRAMES} frames once around, as the view looks while it moves; PNG in a ZIP`,
    run: () => exportTurntable("png", "interactive"),
  },
  {
    label: "Turntable, exact",
    help: `Each of ${TURNTABLE_FRAMES} frames as where the eye rests; takes as long for each`,
    run: () => exportTurntable("png", "exact"),
  },
  { label: "Turntable as a video", help: "The quick one as MP4", run: () => exportTurntable("mp4", "interactive") },
];

const TURNTABLE_LABELS: Record<TurntableRotation, string> = {
  camera: "the eye goes around",
  object: "the object turns, under light that stays",
  environment: "the environment turns alone",
};

/** What the turntables turn. */
function TurntableSelect() {
  return (
    <li>
      <label>
        Turntable
        <select value={turntableRotation.value} onChange={(event) => (turntableRotation.value = event.currentTarget.value as TurntableRotation)}>
          {Object.entries(TURNTABLE_LABELS).map(([value, label]) => (
            <option key={value} value={value}>
              {label}
            </option>
          ))}
        </select>
      </label>
    </li>
  );
}

/** Which color space EXR files are in, where the server has a config. */
function ColorSpaceSelect() {
  return (
    <li>
      <label>
        EXR in
        <select value={availableExrSpace.value ?? ""} onChange={(event) => (exrSpace.value = event.currentTarget.value)}>
          <option value="">linear Rec. 709</option>
          {exrSpaces.value.map((name) => (
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
  displayedFrames.value;
  const isUnavailable = look.value === null || !stage.active.hasPixels;
  const busy = isUnavailable || exporting.value !== null;
  const onEscape = (event: KeyboardEvent) => {
    if (event.key !== "Escape" || !open) return;
    event.stopPropagation(); // a menu that the buttons are in stays
    setOpen(false);
  };
  return (
    <div class="menu" onKeyDown={onEscape}>
      <div class="group" role="group" aria-label="Export">
        <button
          title={`Export ${exportTargetLabel()} as displayed (Ctrl+Shift+S)${lightFilterText()}`}
          disabled={isUnavailable}
          onClick={() => void exportPng()}
        >
          PNG
        </button>
        <button
          title={`Export the linear radiance of ${exportTargetLabel()}${availableExrSpace.value === null ? "" : ` in ${availableExrSpace.value}`}, with a layer for each light${lightFilterText()}`}
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
          {(hasFreeCamera.value ? [...IMAGE_EXPORTS, ...TURNTABLE_EXPORTS] : IMAGE_EXPORTS).map(({ label, help, run }) => (
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
          {hasFreeCamera.value && <TurntableSelect />}
          {exrSpaces.value.length > 0 && <ColorSpaceSelect />}
        </ul>
      )}
    </div>
  );
}
