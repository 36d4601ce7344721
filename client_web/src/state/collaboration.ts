/** Who works on this look together, and by which link this one has come. */
import { computed, effect, signal } from "@preact/signals";
import type { Person } from "../protocol";

/** Opens the room of a scene: its id, or a view token for those who only watch. */
export interface JoinState {
  scene: string;
  room: string | null;
  watch: string | null;
  /** The shared look that the room begins with where nobody is in it. */
  share: string | null;
}

/** The room that is asked for; null for one who works alone. */
export const joinState = signal<JoinState | null>(null);
export const members = signal<readonly Person[]>([]);
/** The own number among them. */
export const selfNumber = signal<number | null>(null);

/** Whether others share this look. */
export const isInRoom = computed(() => selfNumber.value !== null);

/** The other members as text that changes seldom; null if alone. */
export const membersText = computed(() => {
  const otherMembers = members.value.filter(({ id }) => id !== selfNumber.value);
  const memberNames = otherMembers.map(({ name, online }) => (online ? name : `${name}, whose connection is lost`));
  return memberNames.length === 0 ? null : `Together with ${memberNames.join(", ")}`;
});

/** Come by a link that lets nobody edit. */
export const isWatching = computed(() => joinState.value !== null && joinState.value.room === null);

const NAME_KEY = "relume.name";

function loadName(): string {
  try {
    return localStorage.getItem(NAME_KEY) ?? "";
  } catch {
    return ""; // forbidden: the server calls them something
  }
}

/** As this one wants to be called where nobody logs in; empty: as the server likes. */
export const ownName = signal("");

/** Load the stored name, and store its changes. */
export function trackName(): void {
  ownName.value = loadName();
  effect(() => {
    try {
      localStorage.setItem(NAME_KEY, ownName.value);
    } catch {
      // it is asked for again next time
    }
  });
}

const memberTokenKey = ({ scene, room, watch }: JoinState) => `relume.seat.${scene}.${room ?? watch}`;

/** The participant token of this tab in a room; null without one. */
export function loadMemberToken(target: JoinState): string | null {
  try {
    return sessionStorage.getItem(memberTokenKey(target));
  } catch {
    return null;
  }
}

export function saveMemberToken(target: JoinState, token: string): void {
  try {
    sessionStorage.setItem(memberTokenKey(target), token);
  } catch {
    // a reload is a new member, until the old token expires
  }
}
