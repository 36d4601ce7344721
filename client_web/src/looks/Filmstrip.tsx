/** Saved looks, and the steps of this visit: click one to return to it. */
import { useEffect, useRef } from "preact/hooks";
import { isSame } from "../document/difference";
import { passing, replaceLook } from "../edit/edit";
import { history } from "../edit/history";
import { stepWords } from "../edit/step";
import { connect } from "../live/connect";
import type { Look } from "../protocol";
import { bake } from "../state/bakes";
import { defaultLook, look } from "../state/look";
import { mayEdit, watched } from "../state/me";
import { timelineOpen } from "../state/panels";
import { scene } from "../state/scene";
import { lookThumbnail, thumbnailsMade } from "../state/thumbnails";
import { IconButton } from "../ui/Button";
import { EditableName } from "../ui/EditableName";
import { Icon } from "../ui/Icon";
import { completed, justSaved, markLook, saveLook, sideA } from "./compare";
import { thumbnailOf, variantThumbnail } from "./namedThumbnails";
import { deleteLook, refreshShelf, renameLook, shelf, updateLook, type SavedLook } from "./shelf";
import { goTo } from "./undo";

const MAX_STEPS = 40;
const MAX_NAME = 80;

function Name({ saved }: { saved: SavedLook }) {
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

function Picture({ image, text }: { image: string | null; text: string }) {
  return image === null ? <span class="blank">{text.slice(0, 2)}</span> : <img src={image} alt="" draggable={false} />;
}

/** Take a saved look over; for one who only looks the session begins again with it. */
function showSaved(name: string, whole: Look): void {
  const [of, current] = [scene.value, bake.value];
  if (mayEdit.value || of === null || current === null) return replaceLook(`Show ${name}`, whole);
  watched.value = { scene: of.id, look: name };
  connect(current);
}

function SavedTile({ saved }: { saved: SavedLook }) {
  thumbnailsMade.value;
  const whole = completed(saved.look);
  const shown = isSame(whole, look.value);
  return (
    <li class={`tile ${shown ? "shown" : ""}`}>
      <button
        class="tile-picture"
        aria-label={`Show ${saved.name}`}
        aria-pressed={shown}
        onClick={() => showSaved(saved.name, whole)}
      >
        <Picture image={thumbnailOf(saved.etag)} text={saved.name} />
        {sideA.value?.label === saved.name && <span class="mark">A</span>}
      </button>
      <span class="tile-actions">
        <button
          class="icon"
          title={`Compare with ${saved.name}: keep it as A`}
          aria-label={`Keep ${saved.name} as A`}
          onClick={() => void markLook(whole, saved.name)}
        >
          A
        </button>
        <IconButton
          icon="save"
          label={`Save the live look over ${saved.name}`}
          disabled={shown || !mayEdit.value}
          onClick={() => look.value && void updateLook(saved, look.value)}
        />
        <IconButton icon="trash" label={`Delete ${saved.name}`} disabled={!mayEdit.value} onClick={() => void deleteLook(saved)} />
      </span>
      <Name saved={saved} />
    </li>
  );
}

/** A look that came with the scene's file: to show, to compare with, not to change. */
function VariantTile({ name, partial }: { name: string; partial: Partial<Look> }) {
  thumbnailsMade.value;
  const whole = completed(partial);
  const shown = isSame(whole, look.value);
  return (
    <li class={`tile ${shown ? "shown" : ""}`}>
      <button
        class="tile-picture"
        aria-label={`Show ${name}`}
        aria-pressed={shown}
        onClick={() => replaceLook(`Show ${name}`, whole)}
      >
        <Picture image={variantThumbnail(name)} text={name} />
        {sideA.value?.label === name && <span class="mark">A</span>}
      </button>
      <span class="tile-actions">
        <button
          class="icon"
          title={`Compare with ${name}: keep it as A`}
          aria-label={`Keep ${name} as A`}
          onClick={() => void markLook(whole, name)}
        >
          A
        </button>
      </span>
      <span class="tile-name" title={`${name}, a variant of the scene's file`}>
        {name}
      </span>
    </li>
  );
}

function Variants() {
  const variants = scene.value?.variants ?? [];
  if (variants.length === 0) return null;
  return (
    <>
      <h2>Variants</h2>
      <ul class="tiles saved" aria-label="Variants of the scene">
        {variants.map(({ name, look: partial }) => (
          <VariantTile key={name} name={name} partial={partial as Partial<Look>} />
        ))}
      </ul>
    </>
  );
}

/** What was edited on a line of its own, so that a long name leaves room for what was done. */
function StepWords({ label }: { label: string }) {
  const { of, deed } = stepWords(label);
  return (
    <span class="tile-name" title={label}>
      {of !== null && <span class="of">{of}</span>}
      <span class="deed">{deed}</span>
    </span>
  );
}

function StepTile({ count, label, of }: { count: number; label: string; of: Look | undefined }) {
  const current = history.cursor.value === count;
  const undone = count > history.cursor.value;
  return (
    <li class={`tile step ${current ? "shown" : ""} ${undone ? "undone" : ""}`}>
      <button
        class="tile-picture"
        aria-label={`Go to step ${count}: ${label}`}
        aria-current={current ? "step" : undefined}
        onClick={() => goTo(count)}
      >
        <Picture image={lookThumbnail(of)} text={label} />
      </button>
      <StepWords label={label} />
    </li>
  );
}

function Steps() {
  const strip = useRef<HTMLUListElement>(null);
  const steps = history.steps.value;
  const showCurrent = () => strip.current?.querySelector(".shown")?.scrollIntoView({ block: "nearest", inline: "nearest" });
  useEffect(showCurrent, [history.cursor.value, steps.length]);
  useEffect(() => {
    const observer = new ResizeObserver(showCurrent); // saved looks and variants that arrive take room from it
    observer.observe(strip.current as Element);
    return () => observer.disconnect();
  }, []);
  const first = Math.max(0, steps.length - MAX_STEPS);
  const opened = steps.find((step) => step.of === "look")?.before ?? passing.value?.before ?? look.value ?? undefined;
  // steps that are not of the look (one was deleted) show the picture before them
  let last = opened;
  const tiles = steps.map((step, i) => {
    if (step.of === "look") last = step.after;
    return { count: i + 1, label: step.label, of: last };
  });
  return (
    <ul class="tiles" ref={strip} aria-label="Steps of this visit">
      {first === 0 && <StepTile count={0} label="Opened" of={opened} />}
      {tiles.slice(first).map((tile) => (
        <StepTile key={tile.count} {...tile} />
      ))}
    </ul>
  );
}

export function Filmstrip() {
  useEffect(() => void (scene.value !== null && refreshShelf()), [scene.value?.id]);
  return (
    <section class="filmstrip" aria-label="Looks">
      <h2>Looks</h2>
      <button
        class="save"
        onClick={() => void saveLook()}
        disabled={look.value === null || !mayEdit.value}
        title="Save the live look (Ctrl+S)"
      >
        <Icon name="plus" />
        Save look
      </button>
      <button
        class="save"
        disabled={!mayEdit.value}
        aria-expanded={timelineOpen.value}
        onClick={() => (timelineOpen.value = !timelineOpen.value)}
        title="Play looks one after another, and render what lies between (M)"
      >
        <Icon name="film" />
        Time line
      </button>
      {defaultLook.value !== null && shelf.value.length > 0 && (
        <ul class="tiles saved" aria-label="Saved looks">
          {shelf.value.map((saved) => (
            <SavedTile key={saved.name} saved={saved} />
          ))}
        </ul>
      )}
      {defaultLook.value !== null && <Variants />}
      <h2>History</h2>
      <Steps />
    </section>
  );
}
