/** The editor's layout: what stands where. Everything but the picture collapses. */
import { ReadOnly } from "../account/Account";
import { CommentsPanel } from "../comments/CommentsPanel";
import { Inspector } from "../inspector/Inspector";
import { LibraryPanel } from "../library/LibraryPanel";
import { Filmstrip } from "../looks/Filmstrip";
import { Outline } from "../outline/Outline";
import { useFileDrop } from "../start/useFileDrop";
import { filmstripOpen, helpOpen, timelineOpen } from "../state/panels";
import { mayEdit } from "../state/me";
import { inspectorShownWidth, panelWidths, shownPanels, type SidePanel } from "../state/room";
import { Timeline } from "../timeline/Timeline";
import { TruthPanel } from "../truth/TruthPanel";
import { Splitter } from "../ui/Splitter";
import { PictureView } from "../viewport/PictureView";
import { Help } from "./Help";
import { StatusBar } from "./StatusBar";
import { TopBar } from "./TopBar";
import { DropHint } from "./DropHint";
import { takeDropped } from "./dropped";
import { useKeyboard } from "./keyboard";

export function Editor() {
  useKeyboard();
  const { outline, library, truth, comments } = panelWidths.value;
  const widths = { outline, library, truth, comments, inspector: inspectorShownWidth.value };
  const style = Object.fromEntries(Object.entries(widths).map(([name, width]) => [`--${name}`, `${width}px`]));
  const shown = (name: SidePanel) => shownPanels.value.includes(name);
  const over = useFileDrop(takeDropped);
  return (
    <div class={`editor ${over ? "over" : ""}`} style={style}>
      <TopBar />
      <div class="middle">
        {shown("outline") && <Outline />}
        <PictureView />
        {over && <DropHint />}
        {shown("library") && mayEdit.value && <LibraryPanel />}
        {shown("truth") && <TruthPanel />}
        {shown("comments") && <CommentsPanel />}
        {shown("inspector") && (
          <aside class="side" aria-label="Inspector">
            <Splitter />
            <div class="inspected">
              <ReadOnly />
              <div inert={!mayEdit.value}>
                <Inspector />
              </div>
            </div>
          </aside>
        )}
      </div>
      {timelineOpen.value && mayEdit.value && <Timeline />}
      {filmstripOpen.value && <Filmstrip />}
      <StatusBar />
      {helpOpen.value && <Help />}
    </div>
  );
}
