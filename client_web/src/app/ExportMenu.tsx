/** Export: PNG and EXR with one click each; more EXR variants, turntables of free-camera views, and the scene. */
import { useState } from "preact/hooks";
import {
  exportExr,
  exportPng,
  exportTurntable,
  TURNTABLE_FRAMES,
  turntableRotation,
  type TurntableRotation,
} from "../panels/looks/exportImage";
import { exporting } from "../panels/looks/renderJob";
import { stage } from "../render/renderStage";
import { lightFilterText } from "../state/visibility/activeFilters";
import { exrSpace, availableExrSpace, exrSpaces } from "../state/color";
import { displayedFrames } from "../state/display";
import { look } from "../state/look";
import { hasFreeCamera, sideBySide, activeViewName } from "../state/views";
import { RenderDialog } from "./RenderDialog";
import { SceneExportDialog } from "./SceneExportDialog";

/** The exported view, named when several views are shown. */
function exportTargetLabel(): string {
  return sideBySide.value ? `view “${activeViewName.value}”` : "the picture";
}

interface ExportOption {
  label: string;
  help: string;
  run: () => Promise<void>;
}

const IMAGE_EXPORTS: ExportOption[] = [
  {
    label: "EXR with layers",
    help: "Beauty plus one layer per light and per light path",
    run: () => exportExr({ layers: true }),
  },
  {
    label: "EXR with light groups",
    help: "Direct and indirect light of each light; they add up to the beauty layer",
    run: () => exportExr({ layers: "light_groups" }),
  },
  {
    label: "EXR with AOVs",
    help: "Depth, position, normals, UV, albedo, emission, and Cryptomattes of objects and materials",
    run: () => exportExr({ aovs: true }),
  },
  { label: "EXR, beauty only", help: "Faster, smaller", run: () => exportExr({}) },
];

const TURNTABLE_EXPORTS: ExportOption[] = [
  {
    label: "Turntable, fast",
    help: `${TURNTABLE_FRAMES} frames, approximate as while the camera moves; PNG sequence in a ZIP`,
    run: () => exportTurntable("png", "interactive"),
  },
  {
    label: "Turntable, full quality",
    help: `${TURNTABLE_FRAMES} frames at full quality (slow)`,
    run: () => exportTurntable("png", "exact"),
  },
  { label: "Turntable video", help: "The fast turntable as MP4", run: () => exportTurntable("mp4", "interactive") },
];

const TURNTABLE_LABELS: Record<TurntableRotation, string> = {
  camera: "Rotate camera",
  object: "Rotate object, fixed lights",
  environment: "Rotate environment",
};

/** Chooses what rotates in a turntable. */
function TurntableSelect() {
  return (
    <li>
      <label>
        Turntable
        <select
          value={turntableRotation.value}
          onChange={(event) => (turntableRotation.value = event.currentTarget.value as TurntableRotation)}
        >
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

/** Chooses the color space of EXR files, if the server has an OpenColorIO config. */
function ColorSpaceSelect() {
  return (
    <li>
      <label>
        EXR color space
        <select
          value={availableExrSpace.value ?? ""}
          onChange={(event) => (exrSpace.value = event.currentTarget.value)}
        >
          <option value="">Linear Rec. 709</option>
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
  const [openDialog, setOpenDialog] = useState<"render" | "scene" | null>(null);
  const show = (dialog: "render" | "scene") => {
    setOpen(false);
    setOpenDialog(dialog);
  };
  void displayedFrames.value;
  const isUnavailable = look.value === null || !stage.active.hasPixels;
  const busy = isUnavailable || exporting.value !== null;
  const onEscape = (event: KeyboardEvent) => {
    if (event.key !== "Escape" || !open) return;
    event.stopPropagation(); // keeps an enclosing menu open
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
          title={`Export the linear radiance of ${exportTargetLabel()}${availableExrSpace.value === null ? "" : ` in ${availableExrSpace.value}`}, with one layer per light${lightFilterText()}`}
          disabled={busy}
          onClick={() => void exportExr({ layers: true })}
        >
          EXR
        </button>
        <button
          aria-label="More export formats"
          title="More export formats"
          aria-expanded={open}
          onClick={() => setOpen(!open)}
        >
          ▾
        </button>
      </div>
      {open && (
        <ul class="menu-body export-menu">
          {(hasFreeCamera.value ? [...IMAGE_EXPORTS, ...TURNTABLE_EXPORTS] : IMAGE_EXPORTS).map(
            ({ label, help, run }) => (
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
            ),
          )}
          <li>
            <button disabled={isUnavailable} onClick={() => show("render")}>
              Render…
            </button>
            <span>Several looks and views, in any size; contact sheet</span>
          </li>
          <li>
            <button disabled={look.value === null} onClick={() => show("scene")}>
              Scene…
            </button>
            <span>GLB, USD or MaterialX with this look; its light mix</span>
          </li>
          {hasFreeCamera.value && <TurntableSelect />}
          {exrSpaces.value.length > 0 && <ColorSpaceSelect />}
        </ul>
      )}
      {openDialog === "render" && <RenderDialog onClose={() => setOpenDialog(null)} />}
      {openDialog === "scene" && <SceneExportDialog onClose={() => setOpenDialog(null)} />}
    </div>
  );
}
