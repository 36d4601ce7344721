/** Pictures to take away: PNG and EXR with one click each, and EXR without its layers. */
import { useState } from "preact/hooks";
import { exporting, exportExr, exportPng } from "../looks/export";
import { lightLimitWords } from "../seen/limits";
import { sideBySide, viewName } from "../state/views";

/** What an export is of: with several views shown it must be said. */
function whichView(): string {
  return sideBySide.value ? `the view “${viewName.value}”` : "the picture";
}

const CHOICES = [
  { layers: true, label: "EXR with layers", help: "One for each light and each kind of light path, beside the picture" },
  { layers: false, label: "EXR, the picture alone", help: "Quicker, and a smaller file" },
];

export function ExportMenu() {
  const [open, setOpen] = useState(false);
  const busy = exporting.value !== null;
  const escape = (event: KeyboardEvent) => {
    if (event.key !== "Escape" || !open) return;
    event.stopPropagation(); // a menu that the buttons are in stays
    setOpen(false);
  };
  return (
    <div class="menu" onKeyDown={escape}>
      <div class="group" role="group" aria-label="Export">
        <button title={`Export ${whichView()} as displayed (Ctrl+Shift+S)${lightLimitWords()}`} onClick={() => void exportPng()}>
          PNG
        </button>
        <button
          title={`Export the linear radiance of ${whichView()}, with a layer for each light${lightLimitWords()}`}
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
          {CHOICES.map(({ layers, label, help }) => (
            <li key={label}>
              <button
                disabled={busy}
                onClick={() => {
                  setOpen(false);
                  void exportExr(layers);
                }}
              >
                {label}
              </button>
              <span>{help}</span>
            </li>
          ))}
        </ul>
      )}
    </div>
  );
}
