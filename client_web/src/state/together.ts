/** Who works on this look together, and by which link this one has come. */
import { computed, effect, signal } from "@preact/signals";
import type { Person } from "../protocol";

/** What opens the room of a scene: its id, or for those who only watch another word. */
export interface Door {
  scene: string;
  room: string | null;
  watch: string | null;
  /** The shared look that the room begins with where nobody is in it. */
  share: string | null;
}

/** The room that is asked for; null for one who works alone. */
export const door = signal<Door | null>(null);
export const people = signal<readonly Person[]>([]);
/** The own number among them. */
export const you = signal<number | null>(null);

/** Whether others share this look. */
export const isTogether = computed(() => you.value !== null);

/** Who else is here, in words that change seldom; null where nobody is. */
export const companyWords = computed(() => {
  const others = people.value.filter(({ number }) => number !== you.value);
  const named = others.map(({ name, here }) => (here ? name : `${name}, whose connection is lost`));
  return named.length === 0 ? null : `Together with ${named.join(", ")}`;
});

/** Come by a link that lets nobody edit. */
export const watching = computed(() => door.value !== null && door.value.room === null);

const NAME = "relume.name";

function recalledName(): string {
  try {
    return localStorage.getItem(NAME) ?? "";
  } catch {
    return ""; // forbidden: the server calls them something
  }
}

/** As this one wants to be called where nobody logs in; empty: as the server likes. */
export const ownName = signal("");

/** Take up the name of the last visit, and keep it for the next. */
export function followName(): void {
  ownName.value = recalledName();
  effect(() => {
    try {
      localStorage.setItem(NAME, ownName.value);
    } catch {
      // it is asked for again next time
    }
  });
}

const seatKey = ({ scene, room, watch }: Door) => `relume.seat.${scene}.${room ?? watch}`;

/** The token of the place that this tab has in a room; null where it has none yet. */
export function seatIn(of: Door): string | null {
  try {
    return sessionStorage.getItem(seatKey(of));
  } catch {
    return null;
  }
}

export function keepSeat(of: Door, seat: string): void {
  try {
    sessionStorage.setItem(seatKey(of), seat);
  } catch {
    // a reload is somebody new, until the old place is given up
  }
}
