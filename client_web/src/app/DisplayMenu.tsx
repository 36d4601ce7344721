/** White balance, contrast and the display LUT of the look, and the difference of A and B; color of the screen. */
import { useCallback, useEffect, useRef, useState } from "preact/hooks";
import { editValue } from "../edit/edit";
import { DEFAULTS, RANGES } from "../look.gen";
import { sideA } from "../panels/looks/abCompare";
import {
  chooseLut,
  currentLut,
  importLutFile,
  loadLuts,
  lutProgress,
  luts,
  LUT_SUFFIX,
  offerToDeleteLut,
} from "../panels/looks/displayLuts";
import { whyUnavailable, type CanvasColor } from "../render/color/canvasColor";
import type { DifferenceMode } from "../render/color/difference";
import { canvasAbilities, canvasColor, canvasColorChoice, chooseCanvasColor } from "../state/canvasColor";
import { difference, isPickingGray } from "../state/display";
import { look } from "../state/look";
import { LabeledSlider } from "../ui/LabeledSlider";
import { useDismiss } from "../ui/useDismiss";

function WhiteBalance() {
  const display = look.value?.display ?? DEFAULTS.display;
  return (
    <>
      <LabeledSlider
        label="Temperature"
        title="Color temperature of the light that shows as white"
        value={display.temperature}
        initial={DEFAULTS.display.temperature}
        {...RANGES.display.temperature}
        scale="log"
        unit="K"
        onChange={(value) => editValue("Temperature", "/display/temperature", Math.round(value))}
      />
      <LabeledSlider
        label="Tint"
        title="Positive: less green"
        value={display.tint}
        initial={DEFAULTS.display.tint}
        {...RANGES.display.tint}
        scale="linear"
        onChange={(value) => editValue("Tint", "/display/tint", value)}
      />
      <button
        aria-pressed={isPickingGray.value}
        title="Click a surface in the image that should be gray; or use “Make gray” of the area probe"
        onClick={() => (isPickingGray.value = !isPickingGray.value)}
      >
        {isPickingGray.value ? "Click a gray surface…" : "Pick gray"}
      </button>
    </>
  );
}

function Contrast() {
  return (
    <LabeledSlider
      label="Contrast"
      title="Steepness about middle gray, before the tone map"
      value={(look.value?.display ?? DEFAULTS.display).contrast}
      initial={DEFAULTS.display.contrast}
      {...RANGES.display.contrast}
      scale="log"
      onChange={(value) => editValue("Contrast", "/display/contrast", value)}
    />
  );
}

function LutSelect() {
  const file = useRef<HTMLInputElement>(null);
  const name = look.value?.display.lut ?? "";
  const current = currentLut.value;
  return (
    <>
      <label>
        LUT
        <select
          title="Applied to display values, after the tone map"
          value={name}
          onChange={(event) => chooseLut(event.currentTarget.value || null)}
        >
          <option value="">None</option>
          {name !== "" && current === null && <option value={name}>{`Missing: ${name}`}</option>}
          {luts.value.map((each) => (
            <option key={each.lut} value={each.lut}>
              {each.name}
            </option>
          ))}
        </select>
      </label>
      <div class="display-lut">
        <button disabled={lutProgress.value !== null} onClick={() => file.current?.click()}>
          Add .cube
        </button>
        {current !== null && <button onClick={() => offerToDeleteLut(current)}>Delete LUT</button>}
      </div>
      <input
        ref={file}
        type="file"
        accept={LUT_SUFFIX}
        hidden
        aria-label="LUT file"
        onChange={(event) => {
          const [chosen] = event.currentTarget.files ?? [];
          if (chosen !== undefined) void importLutFile(chosen);
          event.currentTarget.value = "";
        }}
      />
      <p role="status">{lutProgress.value ?? ""}</p>
    </>
  );
}

function DifferenceSelect() {
  return (
    <label>
      Difference
      <select
        title="Show the difference between A and B (live) in place of the picture"
        disabled={sideA.value === null}
        value={difference.value}
        onChange={(event) => (difference.value = event.currentTarget.value as DifferenceMode)}
      >
        <option value="off">Off</option>
        <option value="stops">A − B in stops</option>
        <option value="delta_e">A − B as ΔE ITP</option>
      </select>
    </label>
  );
}

const SCREEN_COLORS: { color: CanvasColor; label: string }[] = [
  { color: "srgb", label: "Standard (sRGB)" },
  { color: "display-p3", label: "Display P3" },
  { color: "hdr", label: "HDR" },
];

function ScreenSelect() {
  const missing = SCREEN_COLORS.map(({ color }) => whyUnavailable(color, canvasAbilities.value));
  const { tone_map, lut } = look.value?.display ?? DEFAULTS.display;
  const isBounded = tone_map !== "none" || lut !== null;
  return (
    <>
      <label>
        Screen
        <select
          title="Colors of the canvas in this browser; not saved with the look"
          value={canvasColor.value}
          onChange={(event) => chooseCanvasColor(event.currentTarget.value as CanvasColor)}
        >
          {SCREEN_COLORS.map(({ color, label }, index) => (
            <option key={color} value={color} disabled={missing[index] !== null}>
              {label}
            </option>
          ))}
        </select>
      </label>
      {missing.map((reason) => reason !== null && <p key={reason}>{reason}</p>)}
      {canvasColorChoice.value === "hdr" && isBounded && (
        <p>Tone mapping “None” without a LUT shows light brighter than white; the others end at white.</p>
      )}
    </>
  );
}

export function DisplayMenu() {
  const [open, setOpen] = useState(false);
  const menu = useRef<HTMLDivElement>(null);
  const close = useCallback(() => !isPickingGray.peek() && setOpen(false), []);
  useDismiss(open, menu, close);
  useEffect(() => void (open && loadLuts()), [open]);
  const onEscape = (event: KeyboardEvent) => {
    if (event.key !== "Escape" || !open) return;
    event.stopPropagation(); // keeps an enclosing menu open
    isPickingGray.value = false;
    setOpen(false);
  };
  return (
    <div class="menu" ref={menu} onKeyDown={onEscape}>
      <button aria-label="Display options" title="Display options" aria-expanded={open} onClick={() => setOpen(!open)}>
        ▾
      </button>
      {open && (
        <div class="menu-body display-menu" role="group" aria-label="Display options">
          <WhiteBalance />
          <Contrast />
          <LutSelect />
          <DifferenceSelect />
          <ScreenSelect />
        </div>
      )}
    </div>
  );
}
