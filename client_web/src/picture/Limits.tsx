/** What the picture leaves out, each with a way back to the whole. */
import { limitWords } from "../outline/paths";
import { edit } from "../state/edit";
import { hasSource } from "../state/solo";
import { defaultLook, look, solo, soloLight } from "../state/store";

function showAllLight(): void {
  const initial = defaultLook.peek()?.transport;
  if (initial !== undefined) edit("All light", "/transport", initial);
}

function Limit({ words, title, onClick }: { words: string; title: string; onClick(): void }) {
  return (
    <button title={title} onClick={onClick}>
      {words} <span aria-hidden="true">×</span>
    </button>
  );
}

export function Limits() {
  const light = look.value === null ? null : limitWords(look.value.transport);
  const alone = soloLight.value;
  const source = alone !== null && look.value !== null && hasSource(look.value, alone) ? alone : null;
  return (
    <div class="limits">
      {light !== null && <Limit words={light} title="Show all light again" onClick={showAllLight} />}
      {solo.value !== null && (
        <Limit words={`Only ${solo.value}`} title="Show all materials again (S)" onClick={() => (solo.value = null)} />
      )}
      {source !== null && (
        <Limit
          words={`Only the light of ${source || "the environment"}`}
          title="Show all lights again"
          onClick={() => (soloLight.value = null)}
        />
      )}
    </div>
  );
}
