"""What the processes of a team may do: certificates, and the access control of its router."""
