// Chinese. What the server says when it refuses an archive or a session folder, as it says it; {} holds what changes, {2} names the second.

/** @type {Record<string, string>} */
export const texts = {
};
