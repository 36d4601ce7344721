/** Saved looks, and the history steps of this session: click one to return to it. */
import { useEffect, useRef } from "preact/hooks";
import { isDeepEqual } from "../../state/document/difference";
import { previewedStep, replaceLook } from "../../edit/edit";
import { history } from "../../edit/history";
import { splitStepLabel } from "../../edit/stepLabel";
import type { Look } from "../../protocol";
import { defaultLook, look } from "../../state/look";
import { mayEdit } from "../../state/sessionUser";
import { timelineOpen } from "../../state/panels";
import { scene } from "../../state/scene";
import { lookThumbnail, thumbnailRevision } from "../../state/thumbnails";
import { IconButton } from "../../ui/IconButton";
import { EditableName } from "../../ui/EditableName";
import { Icon } from "../../ui/Icon";
import { completeLook, justSaved, storeLookAsA, saveLook, sideA } from "./abCompare";
import { thumbnailOf, variantThumbnail } from "./namedThumbnails";
import { currentView } from "./lookViews";
import {
  deleteLook,
  refreshSavedLooks,
  renameLook,
  savedLooks,
  setLookView,
  updateLook,
  type SavedLook,
} from "./savedLooks";
import { showSaved } from "./showLook";
import { goToStep } from "./undoRedo";
import { serverUrl } from "../../session/net/serverUrl";

const MAX_STEPS = 40;
const MAX_NAME = 80;

function LookName({ saved }: { saved: SavedLook }) {
  const isNew = justSaved.value === saved.name;
  return (
    <EditableName
      key={saved.name}
      class="tile-name"
      name={saved.name}
      maximum={MAX_NAME}
      editing={isNew}
      onRename={(name) => void renameLook(saved, name.replace(/[/\\]/g, "-"))}
      onDone={() => isNew && (justSaved.value = null)}
    />
  );
}

function TileImage({ image, text }: { image: string | null; text: string }) {
  return image === null ? (
    <span class="blank">{text.slice(0, 2)}</span>
  ) : (
    <img src={serverUrl(image)} alt="" draggable={false} />
  );
}

function SavedTile({ saved, number }: { saved: SavedLook; number: number }) {
  void thumbnailRevision.value;
  const fullLook = completeLook(saved.look);
  const isDisplayed = isDeepEqual(fullLook, look.value);
  return (
    <li class={`tile ${isDisplayed ? "shown" : ""}`}>
      <button
        class="tile-picture"
        aria-label={`Show ${saved.name}`}
        title={number <= 9 ? `Show ${saved.name} (${number})` : `Show ${saved.name}`}
        aria-pressed={isDisplayed}
        onClick={() => showSaved(saved)}
      >
        <TileImage image={thumbnailOf(saved.etag)} text={saved.name} />
        {sideA.value?.label === saved.name && <span class="mark">A</span>}
      </button>
      <span class="tile-actions">
        <button
          class="icon"
          title={`Compare: store ${saved.name} as A`}
          aria-label={`Store ${saved.name} as A`}
          onClick={() => void storeLookAsA(fullLook, saved.name)}
        >
          A
        </button>
        <IconButton
          icon="save"
          label={`Overwrite ${saved.name} with the current look`}
          disabled={isDisplayed || !mayEdit.value}
          onClick={() => look.value && void updateLook(saved, look.value)}
        />
        <IconButton
          icon={saved.view === null ? "view" : "lock"}
          label={
            saved.view === null
              ? `Save this view with ${saved.name}`
              : `Remove view “${saved.view.view}” from ${saved.name}`
          }
          disabled={!mayEdit.value}
          onClick={() => void setLookView(saved, saved.view === null ? currentView() : null)}
        />
        <IconButton
          icon="trash"
          label={`Delete ${saved.name}`}
          disabled={!mayEdit.value}
          onClick={() => void deleteLook(saved)}
        />
      </span>
      <LookName saved={saved} />
    </li>
  );
}

/** A variant from the scene's file: can be shown and compared, not changed. */
function VariantTile({ name, partial }: { name: string; partial: Partial<Look> }) {
  void thumbnailRevision.value;
  const fullLook = completeLook(partial);
  const isDisplayed = isDeepEqual(fullLook, look.value);
  return (
    <li class={`tile ${isDisplayed ? "shown" : ""}`}>
      <button
        class="tile-picture"
        aria-label={`Show ${name}`}
        aria-pressed={isDisplayed}
        onClick={() => replaceLook(`Show ${name}`, fullLook)}
      >
        <TileImage image={variantThumbnail(name)} text={name} />
        {sideA.value?.label === name && <span class="mark">A</span>}
      </button>
      <span class="tile-actions">
        <button
          class="icon"
          title={`Compare: store ${name} as A`}
          aria-label={`Store ${name} as A`}
          onClick={() => void storeLookAsA(fullLook, name)}
        >
          A
        </button>
      </span>
      <span class="tile-name" title={`${name}, a variant from the scene file`}>
        {name}
      </span>
    </li>
  );
}

function SceneVariants() {
  const variants = scene.value?.variants ?? [];
  if (variants.length === 0) return null;
  return (
    <>
      <h2>Variants</h2>
      <ul class="tiles saved" aria-label="Scene variants">
        {variants.map(({ name, look: partial }) => (
          <VariantTile key={name} name={name} partial={partial as Partial<Look>} />
        ))}
      </ul>
    </>
  );
}

/** A step's label with the object on its own line, so that a long name leaves room for the action. */
function StepLabel({ label }: { label: string }) {
  const { subject, action } = splitStepLabel(label);
  return (
    <span class="tile-name" title={label}>
      {subject !== null && <span class="of">{subject}</span>}
      <span class="deed">{action}</span>
    </span>
  );
}

function StepTile({ count, label, look }: { count: number; label: string; look: Look | undefined }) {
  const current = history.cursor.value === count;
  const undone = count > history.cursor.value;
  return (
    <li class={`tile step ${current ? "shown" : ""} ${undone ? "undone" : ""}`}>
      <button
        class="tile-picture"
        aria-label={`Go to step ${count}: ${label}`}
        aria-current={current ? "step" : undefined}
        onClick={() => goToStep(count)}
      >
        <TileImage image={lookThumbnail(look)} text={label} />
      </button>
      <StepLabel label={label} />
    </li>
  );
}

function HistorySteps() {
  const strip = useRef<HTMLUListElement>(null);
  const steps = history.steps.value;
  const showCurrent = () =>
    strip.current?.querySelector(".shown")?.scrollIntoView({ block: "nearest", inline: "nearest" });
  const cursor = history.cursor.value;
  useEffect(showCurrent, [cursor, steps.length]);
  useEffect(() => {
    const observer = new ResizeObserver(showCurrent); // loading saved looks and variants shrinks the strip
    observer.observe(strip.current as Element);
    return () => observer.disconnect();
  }, []);
  const first = Math.max(0, steps.length - MAX_STEPS);
  const opened =
    steps.find((step) => step.kind === "look")?.before ?? previewedStep.value?.before ?? look.value ?? undefined;
  // steps without a look, such as a deletion, show the previous image
  let last = opened;
  const tiles = steps.map((step, i) => {
    if (step.kind === "look") last = step.after;
    return { count: i + 1, label: step.label, look: last };
  });
  return (
    <ul class="tiles" ref={strip} aria-label="History">
      {first === 0 && <StepTile count={0} label="Opened" look={opened} />}
      {tiles.slice(first).map((tile) => (
        <StepTile key={tile.count} {...tile} />
      ))}
    </ul>
  );
}

export function Filmstrip() {
  const sceneId = scene.value?.id;
  useEffect(() => {
    if (sceneId !== undefined) void refreshSavedLooks();
  }, [sceneId]);
  return (
    <section class="filmstrip" aria-label="Looks">
      <h2>Looks</h2>
      <button
        class="save"
        onClick={() => void saveLook()}
        disabled={look.value === null || !mayEdit.value}
        title="Save the current look (Ctrl+S)"
      >
        <Icon name="plus" />
        Save look
      </button>
      <button
        class="save"
        disabled={!mayEdit.value}
        aria-expanded={timelineOpen.value}
        onClick={() => (timelineOpen.value = !timelineOpen.value)}
        title="Play and render transitions between looks (M)"
      >
        <Icon name="film" />
        Timeline
      </button>
      {defaultLook.value !== null && savedLooks.value.length > 0 && (
        <ul class="tiles saved" aria-label="Saved looks">
          {savedLooks.value.map((saved, index) => (
            <SavedTile key={saved.name} saved={saved} number={index + 1} />
          ))}
        </ul>
      )}
      {defaultLook.value !== null && <SceneVariants />}
      <h2>History</h2>
      <HistorySteps />
    </section>
  );
}
