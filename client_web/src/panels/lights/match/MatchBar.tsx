/** Bar of the match tool: kind of stroke, brush, reference picture, locks, and the result as text. */
import type { Signal } from "@preact/signals";
import { useEffect, useRef, useState } from "preact/hooks";
import { fromHex, toHex } from "../../../render/color/colorMath";
import { isMatchOpen } from "../../../state/match";
import { RadioRow, type RadioOption } from "../../../ui/RadioRow";
import { Slider } from "../../../ui/Slider";
import { reportErrors } from "../../../ui/toasts";
import { MatchLock } from "../MatchLock";
import {
  brushRadius,
  changesColor,
  changesMaterials,
  ENVIRONMENT_POINTER,
  fitsExposure,
  matchPicture,
  matchStatus,
  referencePicture,
  rotatesEnvironment,
  setReference,
  strokeColor,
  strokeKind,
  strokeStops,
  toggleMatch,
  type StrokeKind,
} from "./match";

const KINDS: readonly RadioOption<StrokeKind>[] = [
  { value: "brighter", label: "Brighter", title: "Paint where you want more light" },
  { value: "darker", label: "Darker", title: "Paint where you want less light" },
  { value: "color", label: "Color", title: "Paint the color of the light; brightness stays" },
];
const REFERENCE: RadioOption<StrokeKind> = {
  value: "reference",
  label: "Reference",
  title: "Paint where the reference picture corresponds",
};

function Reference() {
  const [isOver, setOver] = useState(false);
  const input = useRef<HTMLInputElement>(null);
  const read = (files: FileList | null | undefined) => {
    const file = files?.[0];
    if (file !== undefined) void reportErrors(() => setReference(file));
  };
  return (
    <>
      <button
        class={`reference-drop ${isOver ? "over" : ""}`}
        title="PNG, JPEG, WebP, HDR or EXR"
        onClick={() => input.current?.click()}
        onDragOver={(event) => (event.preventDefault(), event.stopPropagation(), setOver(true))}
        onDragLeave={() => setOver(false)}
        onDrop={(event) => {
          event.preventDefault();
          event.stopPropagation();
          setOver(false);
          read(event.dataTransfer?.files);
        }}
      >
        {referencePicture.value?.name ?? "Drop a reference picture here"}
      </button>
      <input
        ref={input}
        type="file"
        hidden
        aria-label="Reference picture"
        accept=".png,.jpg,.jpeg,.webp,.hdr,.exr"
        onChange={(event) => read(event.currentTarget.files)}
      />
      {referencePicture.value !== null && (
        <>
          <button title="Match the whole picture to the reference" onClick={matchPicture}>
            Match
          </button>
          <Choice
            label="Any exposure"
            title="Only the relative brightness of the reference picture counts"
            choice={fitsExposure}
          />
          <Choice label="Colors" title="Colors of lights may change, too" choice={changesColor} />
          <Choice
            label="Rotate environment"
            title="Also search the rotation of the environment; takes seconds"
            choice={rotatesEnvironment}
          />
        </>
      )}
    </>
  );
}

function Choice({ label, title, choice }: { label: string; title: string; choice: Signal<boolean> }) {
  return (
    <label title={title}>
      <input
        type="checkbox"
        checked={choice.value}
        onChange={(event) => (choice.value = event.currentTarget.checked)}
      />
      {label}
    </label>
  );
}

function StrokeAmount() {
  if (strokeKind.value === "reference") return null;
  if (strokeKind.value === "color")
    return (
      <input
        type="color"
        aria-label="Color of the light"
        title="Color of the light"
        value={toHex(strokeColor.value)}
        onInput={(event) => (strokeColor.value = fromHex(event.currentTarget.value, strokeColor.peek()))}
      />
    );
  return (
    <Slider
      label="Amount"
      value={strokeStops.value}
      initial={1}
      minimum={0.1}
      maximum={4}
      step={0.1}
      scale="linear"
      unit="EV"
      onChange={(value) => (strokeStops.value = value)}
    />
  );
}

function OpenBar() {
  const bar = useRef<HTMLDivElement>(null);
  useEffect(() => bar.current?.querySelector<HTMLElement>("[role=radio][tabindex='0']")?.focus(), []);
  const kinds = referencePicture.value === null ? KINDS : [...KINDS, REFERENCE];
  return (
    <div ref={bar} class="placing matching" role="group" aria-label="Match lights">
      <RadioRow
        label="Stroke"
        choices={kinds}
        selected={strokeKind.value}
        onSelect={(kind) => (strokeKind.value = kind)}
      />
      <StrokeAmount />
      <Slider
        label="Brush"
        value={brushRadius.value}
        initial={40}
        minimum={4}
        maximum={400}
        scale="log"
        unit="px"
        onChange={(value) => (brushRadius.value = value)}
      />
      <MatchLock label="environment" pointer={ENVIRONMENT_POINTER} />
      <Choice
        label="Also the materials"
        title="When a stroke ends, also change the materials painted on; takes seconds"
        choice={changesMaterials}
      />
      <Reference />
      <button title="Close (Esc)" onClick={toggleMatch}>
        Close
      </button>
      <p role="status">{matchStatus.value}</p>
    </div>
  );
}

export function MatchBar() {
  return isMatchOpen.value ? <OpenBar /> : null;
}
