/** Scene, views, undo, comparison, display, export. */
import { Account } from "../account/Account";
import { TONE_MAPS } from "../color/tonemap";
import { edit } from "../edit/edit";
import { history } from "../edit/history";
import { markA, sideA, swapA, toggleWipe } from "../looks/compare";
import { redo, undo } from "../looks/undo";
import type { Look } from "../protocol";
import { leave } from "../scene/open";
import { colorConfig, fromKey, isHere, keyOf } from "../state/color";
import { showBefore, wipe } from "../state/display";
import { look } from "../state/look";
import { mayEdit } from "../state/me";
import { filmstripOpen, helpOpen } from "../state/panels";
import { shownPanels, togglePanel, type SidePanel } from "../state/room";
import { scene } from "../state/scene";
import { showAlone, sideBySide, toggleSideBySide, viewName, views } from "../state/views";
import { Together } from "../together/Together";
import { IconButton } from "../ui/Button";
import { Slider } from "../ui/Slider";
import { Switch } from "../ui/Switch";
import { useDrag } from "../ui/drag";
import { BakeMenu } from "./BakeMenu";
import { ExportMenu } from "./ExportMenu";
import { Overflow } from "./Overflow";
import { RemarksMenu } from "./RemarksMenu";
import { ShareButton } from "./ShareButton";

function Views() {
  if (views.value.length < 2) return null;
  return (
    <div class="group views" role="group" aria-label="Views">
      {views.value.map((view) => (
        <button
          key={view.name}
          aria-pressed={!sideBySide.value && view.name === viewName.value}
          title={`Show “${view.name}” alone`}
          onClick={() => showAlone(view.name)}
        >
          {view.name}
        </button>
      ))}
      <IconButton
        icon="grid"
        label="Views side by side"
        keys="V"
        pressed={sideBySide.value}
        onClick={toggleSideBySide}
      />
    </div>
  );
}

function Compare() {
  const none = sideA.value === null;
  const hand = useDrag({
    begin: (event) => (showBefore.value = event.button === 0),
    end: () => (showBefore.value = false),
  });
  const label = none ? "nothing yet" : (sideA.value?.label ?? "");
  return (
    <div class="group" role="group" aria-label="Compare">
      <button class="letter" title={`Keep this picture as A (A). A is: ${label}`} onClick={markA}>
        A
      </button>
      <IconButton
        icon="wipe"
        label="Wipe between A and B, the live picture"
        keys="W"
        pressed={wipe.value.on}
        disabled={none}
        onClick={toggleWipe}
      />
      <button
        title="Show A while held (C)"
        aria-pressed={showBefore.value}
        disabled={none}
        {...hand}
        onKeyDown={(event) => (event.key === " " || event.key === "Enter") && (showBefore.value = true)}
        onKeyUp={() => (showBefore.value = false)}
        onBlur={() => (showBefore.value = false)}
      >
        Show A
      </button>
      <button title="Swap A and B: the live look becomes A, and A becomes live (X)" disabled={none} onClick={swapA}>
        Swap
      </button>
    </div>
  );
}

function Display() {
  const display = look.value?.display ?? { exposure: 0, tone_map: "agx" };
  return (
    <div class="display-controls" title="Exposure and tone map">
      <span class="label">Exposure</span>
      <Slider
        label="Exposure"
        value={display.exposure}
        initial={0}
        minimum={-8}
        maximum={8}
        scale="linear"
        unit="EV"
        onChange={(value) => edit("Exposure", "/display/exposure", value)}
      />
      <ToneMapChoice chosen={display.tone_map} />
    </div>
  );
}

/** Tone maps of our own, and the views of the server's OpenColorIO config by their displays. */
function ToneMapChoice({ chosen }: { chosen: Look["display"]["tone_map"] }) {
  const isMissing = typeof chosen !== "string" && colorConfig.value !== null && !isHere(chosen);
  const words = typeof chosen === "string" ? "Tone map" : `${chosen.view}, for the display ${chosen.display}`;
  return (
    <select
      class="tone-map"
      aria-label="Tone map"
      title={isMissing ? `${words}: this server has no such view, so AgX is shown` : words}
      value={keyOf(chosen)}
      onChange={(event) => edit("Tone map", "/display/tone_map", fromKey(event.currentTarget.value))}
    >
      {TONE_MAPS.map(({ name, label }) => (
        <option key={name} value={name}>
          {label}
        </option>
      ))}
      {isMissing && <option value={keyOf(chosen)}>{`AgX, not here: ${chosen.view}`}</option>}
      {colorConfig.value?.displays.map(({ name, views }) => (
        <optgroup key={name} label={name}>
          {views.map((view) => (
            <option key={view} value={keyOf({ display: name, view })}>
              {view}
            </option>
          ))}
        </optgroup>
      ))}
    </select>
  );
}

function History() {
  return (
    <div class="group" role="group" aria-label="History">
      <IconButton icon="undo" label="Undo" keys="Ctrl+Z" disabled={!history.canUndo} onClick={undo} />
      <IconButton icon="redo" label="Redo" keys="Ctrl+Shift+Z" disabled={!history.canRedo} onClick={redo} />
    </div>
  );
}

function Side({ icon, label, panel }: { icon: "left" | "right"; label: string; panel: SidePanel }) {
  const shown = shownPanels.value.includes(panel);
  return <IconButton icon={icon} label={label} pressed={shown} onClick={() => togglePanel(panel)} />;
}

function Panels() {
  return (
    <div class="group" role="group" aria-label="Panels">
      <Side icon="left" label="Scene panel" panel="outline" />
      <Switch icon="bottom" label="Looks" of={filmstripOpen} />
      <Side icon="right" label="Inspector" panel="inspector" />
    </div>
  );
}

/** What a narrow window puts into a menu; the lowest rank goes first. */
const CONTROLS = [
  { name: "views", rank: 4, Content: Views },
  { name: "steps", rank: 5, Content: History },
  { name: "compare", rank: 2, Content: Compare },
  { name: "display", rank: 3, Content: Display },
  { name: "export", rank: 1, Content: ExportMenu },
  { name: "share", rank: 0, Content: ShareButton },
];

/** What is of no use to one who only looks. */
const OF_EDITORS = new Set(["steps", "share"]);

export function TopBar() {
  const controls = mayEdit.value ? CONTROLS : CONTROLS.filter(({ name }) => !OF_EDITORS.has(name));
  return (
    <header class="top-bar">
      <IconButton icon="back" label="All scenes" onClick={leave} />
      <h1 title={scene.value?.name}>{scene.value?.name ?? "…"}</h1>
      <RemarksMenu />
      <BakeMenu />
      <Overflow controls={controls} />
      <Together />
      <Panels />
      <Account />
      <IconButton
        icon="help"
        label="Keyboard map"
        keys="?"
        pressed={helpOpen.value}
        onClick={() => (helpOpen.value = !helpOpen.value)}
      />
    </header>
  );
}
