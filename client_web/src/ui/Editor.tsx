/** The editor's layout: what stands where. Everything but the picture collapses. */
import { Filmstrip } from "../looks/Filmstrip";
import { LibraryPanel } from "../library/LibraryPanel";
import { Inspector } from "../inspector/Inspector";
import { Outline } from "../outline/Outline";
import { take } from "../outline/environments";
import { PictureView } from "../picture/PictureView";
import { filmstripOpen } from "../state/panels";
import { inspectorShownWidth, panelWidths, shownPanels, type SidePanel } from "../state/room";
import { helpOpen } from "../state/store";
import { TruthPanel } from "../truth/TruthPanel";
import { Help } from "./Help";
import { Splitter } from "./Splitter";
import { StatusBar } from "./StatusBar";
import { TopBar } from "./TopBar";
import { useFileDrop } from "./useFileDrop";
import { useKeyboard } from "./keyboard";

export function Editor() {
  useKeyboard();
  const { outline, library, truth } = panelWidths.value;
  const widths = { outline, library, truth, inspector: inspectorShownWidth.value };
  const style = Object.fromEntries(Object.entries(widths).map(([name, width]) => [`--${name}`, `${width}px`]));
  const shown = (name: SidePanel) => shownPanels.value.includes(name);
  const over = useFileDrop((files) => void take(files.map(({ file }) => file)));
  return (
    <div class={`editor ${over ? "over" : ""}`} style={style}>
      <TopBar />
      <div class="middle">
        {shown("outline") && <Outline />}
        <PictureView />
        {shown("library") && <LibraryPanel />}
        {shown("truth") && <TruthPanel />}
        {shown("inspector") && (
          <aside class="side" aria-label="Inspector">
            <Splitter />
            <Inspector />
          </aside>
        )}
      </div>
      {filmstripOpen.value && <Filmstrip />}
      <StatusBar />
      {helpOpen.value && <Help />}
    </div>
  );
}
