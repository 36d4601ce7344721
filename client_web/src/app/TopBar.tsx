/** The top bar: scene, views, undo, comparison, display, export. */
import { Account } from "./account/Account";
import { TONE_MAPS } from "../render/color/tonemap";
import { editValue } from "../edit/edit";
import { history } from "../edit/history";
import { storeA, sideA, swapWithA, toggleWipe } from "../panels/looks/abCompare";
import { redo, undo } from "../panels/looks/undoRedo";
import type { Look } from "../protocol";
import { closeScene } from "../session/scene/openScene";
import { colorConfig, parseToneMapKey, hasOcioView, toneMapKey } from "../state/color";
import { isReferenceShown, wipe } from "../state/display";
import { look } from "../state/look";
import { mayEdit } from "../state/sessionUser";
import { filmstripOpen, helpOpen } from "../state/panels";
import { shownPanels, togglePanel, type SidePanel } from "../state/panelWidths";
import { scene } from "../state/scene";
import { showSingleView, sideBySide, toggleSideBySide, activeViewName, views } from "../state/views";
import { CollaborationMenu } from "../panels/collaboration/CollaborationMenu";
import { IconButton } from "../ui/IconButton";
import { Slider } from "../ui/Slider";
import { ToggleButton } from "../ui/ToggleButton";
import { useDrag } from "../ui/drag";
import { BakeMenu } from "./BakeMenu";
import { DisplayMenu } from "./DisplayMenu";
import { ExportMenu } from "./ExportMenu";
import { Overflow } from "./Overflow";
import { ImportWarningsMenu } from "./ImportWarningsMenu";
import { ShareButton } from "./ShareButton";

function ViewButtons() {
  if (views.value.length < 2) return null;
  return (
    <div class="group views" role="group" aria-label="Views">
      {views.value.map((view) => (
        <button
          key={view.name}
          aria-pressed={!sideBySide.value && view.name === activeViewName.value}
          title={`Show only “${view.name}”`}
          onClick={() => showSingleView(view.name)}
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

function CompareButtons() {
  const hasNoReference = sideA.value === null;
  const dragHandlers = useDrag({
    begin: (event) => (isReferenceShown.value = event.button === 0),
    end: () => (isReferenceShown.value = false),
  });
  const label = hasNoReference ? "empty" : (sideA.value?.label ?? "");
  return (
    <div class="group" role="group" aria-label="Compare">
      <button class="letter" title={`Store as A (A). Now: ${label}`} onClick={storeA}>
        A
      </button>
      <IconButton
        icon="wipe"
        label="Wipe between A and B (live)"
        keys="W"
        pressed={wipe.value.isOn}
        disabled={hasNoReference}
        onClick={toggleWipe}
      />
      <button
        title="Hold to show A (C)"
        aria-pressed={isReferenceShown.value}
        disabled={hasNoReference}
        {...dragHandlers}
        onKeyDown={(event) => (event.key === " " || event.key === "Enter") && (isReferenceShown.value = true)}
        onKeyUp={() => (isReferenceShown.value = false)}
        onBlur={() => (isReferenceShown.value = false)}
      >
        Show A
      </button>
      <button title="Swap A and B (X)" disabled={hasNoReference} onClick={swapWithA}>
        Swap
      </button>
    </div>
  );
}

function DisplayControls() {
  const display = look.value?.display ?? { exposure: 0, tone_map: "agx" };
  return (
    <div class="display-controls" title="Exposure and tone mapping">
      <span class="label">Exposure</span>
      <Slider
        label="Exposure"
        value={display.exposure}
        initial={0}
        minimum={-8}
        maximum={8}
        scale="linear"
        unit="EV"
        onChange={(value) => editValue("Exposure", "/display/exposure", value)}
      />
      <ToneMapSelect toneMap={display.tone_map} />
      <DisplayMenu />
    </div>
  );
}

/** Built-in tone maps, and the views of the server's OpenColorIO config grouped by display. */
function ToneMapSelect({ toneMap }: { toneMap: Look["display"]["tone_map"] }) {
  const isMissing = typeof toneMap !== "string" && colorConfig.value !== null && !hasOcioView(toneMap);
  const tooltip = typeof toneMap === "string" ? "Tone mapping" : `${toneMap.view} (display ${toneMap.display})`;
  return (
    <select
      class="tone-map"
      aria-label="Tone mapping"
      title={isMissing ? `${tooltip}: not in this server's OpenColorIO config, so AgX is used` : tooltip}
      value={toneMapKey(toneMap)}
      onChange={(event) => editValue("Tone mapping", "/display/tone_map", parseToneMapKey(event.currentTarget.value))}
    >
      {TONE_MAPS.map(({ name, label }) => (
        <option key={name} value={name}>
          {label}
        </option>
      ))}
      {isMissing && <option value={toneMapKey(toneMap)}>{`AgX (missing: ${toneMap.view})`}</option>}
      {colorConfig.value?.displays.map(({ name, views }) => (
        <optgroup key={name} label={name}>
          {views.map((view) => (
            <option key={view} value={toneMapKey({ display: name, view })}>
              {view}
            </option>
          ))}
        </optgroup>
      ))}
    </select>
  );
}

function HistoryButtons() {
  return (
    <div class="group" role="group" aria-label="History">
      <IconButton icon="undo" label="Undo" keys="Ctrl+Z" disabled={!history.canUndo} onClick={() => void undo()} />
      <IconButton
        icon="redo"
        label="Redo"
        keys="Ctrl+Shift+Z"
        disabled={!history.canRedo}
        onClick={() => void redo()}
      />
    </div>
  );
}

function PanelToggle({ icon, label, panel }: { icon: "left" | "right"; label: string; panel: SidePanel }) {
  const isShown = shownPanels.value.includes(panel);
  return <IconButton icon={icon} label={label} pressed={isShown} onClick={() => togglePanel(panel)} />;
}

function PanelButtons() {
  return (
    <div class="group" role="group" aria-label="Panels">
      <PanelToggle icon="left" label="Scene panel" panel="outline" />
      <ToggleButton icon="bottom" label="Looks" state={filmstripOpen} />
      <PanelToggle icon="right" label="Inspector" panel="inspector" />
    </div>
  );
}

/** Controls that a narrow window moves into a menu, lowest rank first. */
const CONTROLS = [
  { name: "views", rank: 4, Content: ViewButtons },
  { name: "steps", rank: 5, Content: HistoryButtons },
  { name: "compare", rank: 2, Content: CompareButtons },
  { name: "display", rank: 3, Content: DisplayControls },
  { name: "export", rank: 1, Content: ExportMenu },
  { name: "share", rank: 0, Content: ShareButton },
];

/** Controls hidden from a read-only user. */
const EDITOR_CONTROLS = new Set(["steps", "share"]);

export function TopBar() {
  const controls = mayEdit.value ? CONTROLS : CONTROLS.filter(({ name }) => !EDITOR_CONTROLS.has(name));
  return (
    <header class="top-bar">
      <IconButton icon="back" label="All scenes" onClick={closeScene} />
      <h1 title={scene.value?.name}>{scene.value?.name ?? "…"}</h1>
      <ImportWarningsMenu />
      <BakeMenu />
      <Overflow controls={controls} />
      <CollaborationMenu />
      <PanelButtons />
      <Account />
      <IconButton
        icon="help"
        label="Keyboard shortcuts"
        keys="?"
        pressed={helpOpen.value}
        onClick={() => (helpOpen.value = !helpOpen.value)}
      />
    </header>
  );
}
